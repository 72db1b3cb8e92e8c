#include "treemarch/sizing/layer_sizing.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr double kSlope = 0.5;  // of the depth, towards a neighbour, from which on a voxel is not in the middle

constexpr double kOblique = 1.3;  // the shortest chord over the thickness, at most

template <int Dim>
struct Step {
  Coord<Dim> offset{};
  double length = 0;
  int axes = 0;  ///< along which it goes
};

/// Half of the directions to the neighbours over faces, edges and corners: of each pair of opposites the one that is
/// positive along its last axis.
template <int Dim>
std::vector<Step<Dim>> half_of_directions(const Vec<Dim>& spacing) {
  std::vector<Step<Dim>> steps;
  Coord<Dim> three{};
  three.fill(3);
  for (std::int64_t i = product(three) / 2 + 1; i < product(three); ++i) {
    Step<Dim> s{coord_of(i, three)};
    for (int d = 0; d < Dim; ++d) {
      --s.offset[d];
      s.axes += s.offset[d] != 0;
      s.length += s.offset[d] * s.offset[d] * spacing[d] * spacing[d];
    }
    s.length = std::sqrt(s.length);
    steps.push_back(s);
  }
  return steps;
}

template <int Dim>
bool is_inside(const Coord<Dim>& c, const Coord<Dim>& extent) {
  for (int d = 0; d < Dim; ++d)
    if (c[d] < 0 || c[d] >= extent[d]) return false;
  return true;
}

template <int Dim>
Coord<Dim> moved(Coord<Dim> c, const Coord<Dim>& offset, int by) {
  for (int d = 0; d < Dim; ++d) c[d] += by * offset[d];
  return c;
}

template <int Dim>
class Layers {
 public:
  Layers(const LabelImage<Dim>& image, const Execution& execution)
      : image_(image), execution_(execution), steps_(half_of_directions(image.frame.spacing)) {}

  std::vector<float> sizes(int layers, double smallest, double largest) {
    find_depth(0.5 * layers * largest);
    const std::int64_t n = image_.voxels.size();
    std::vector<float> size(static_cast<std::size_t>(n), 0);
    const double most = layers * largest;
    parallel_for(execution_, n, 4096, [&](std::int64_t i) {
      const Coord<Dim> c = coord_of(i, image_.extent);
      if (2 * depth_[i] >= most || !is_middle(c, i)) return;
      const double thickness = thickness_at(c, most);
      if (thickness < most)
        spread(c, 0.5 * thickness, static_cast<float>(std::max(smallest, thickness / layers)), size);
    });
    return size;
  }

 private:
  /// Distance of voxel centres to the nearest centre beside an interface, up to a limit, in the metric of steps between
  /// neighbours.
  void find_depth(double limit) {
    const std::int64_t n = image_.voxels.size();
    depth_.assign(static_cast<std::size_t>(n), std::numeric_limits<float>::max());
    parallel_for(execution_, n, 4096, [&](std::int64_t i) {
      const Coord<Dim> c = coord_of(i, image_.extent);
      for (int d = 0; d < Dim; ++d)
        for (const int by : {-1, 1}) {
          Coord<Dim> at = c;
          at[d] += by;
          if (is_inside(at, image_.extent) && image_.material(at) != image_.voxels[i]) depth_[i] = 0;
        }
    });
    // Sweeps in which every voxel looks at the state before: exact after as many as there are voxels in the limit.
    const double voxel = *std::ranges::min_element(image_.frame.spacing);
    std::vector<float> next = depth_;
    for (int sweep = 0; sweep < static_cast<int>(std::ceil(limit / voxel)); ++sweep) {
      parallel_for(execution_, n, 4096, [&](std::int64_t i) {
        if (depth_[i] <= static_cast<float>(sweep * voxel)) return;
        const Coord<Dim> c = coord_of(i, image_.extent);
        float best = depth_[i];
        for (const Step<Dim>& s : steps_)
          for (const int by : {-1, 1}) {
            const Coord<Dim> at = moved(c, s.offset, by);
            if (!is_inside(at, image_.extent)) continue;
            best = std::min(best, depth_[linear_index(at, image_.extent)] + static_cast<float>(s.length));
          }
        next[i] = best;
      });
      depth_ = next;
    }
  }
  [[nodiscard]] bool is_middle(const Coord<Dim>& c, std::int64_t i) const {
    for (const Step<Dim>& s : steps_)
      for (const int by : {-1, 1}) {
        const Coord<Dim> at = moved(c, s.offset, by);
        if (!is_inside(at, image_.extent)) continue;
        const std::int64_t k = linear_index(at, image_.extent);
        if (image_.voxels[k] == image_.voxels[i] && depth_[k] - depth_[i] > kSlope * s.length) return false;
      }
    return true;
  }
  /// The shortest chord, or `most` if none is shorter. One that is much longer than twice the depth is that of a cap on
  /// a thick part, not of a layer.
  [[nodiscard]] double thickness_at(const Coord<Dim>& c, double most) const {
    const MaterialId own = image_.material(c);
    const double inner = 2 * kOblique * depth_[linear_index(c, image_.extent)];
    bool is_layer = false;
    double least = most;
    for (const Step<Dim>& s : steps_) {
      int voxels = 1;
      bool cut_off = false;
      for (const int by : {-1, 1}) {
        Coord<Dim> at = moved(c, s.offset, by);
        for (; voxels * s.length < least && is_inside(at, image_.extent) && image_.material(at) == own;
             at = moved(at, s.offset, by))
          ++voxels;
        cut_off = cut_off || !is_inside(at, image_.extent);
      }
      if ((s.axes > 1 && cut_off) || voxels * s.length >= least) continue;
      least = voxels * s.length;
      is_layer = least - 2 * s.length <= inner;
    }
    return is_layer ? least : most;
  }
  /// Lowers the sizes of the voxels of the same label around c.
  void spread(const Coord<Dim>& c, double radius, float size, std::vector<float>& sizes) const {
    const MaterialId own = image_.material(c);
    Coord<Dim> begin{}, extent{};
    for (int d = 0; d < Dim; ++d) {
      const auto reach = static_cast<std::int32_t>(std::ceil(radius / image_.frame.spacing[d]));
      begin[d] = std::max(0, c[d] - reach);
      extent[d] = std::min(image_.extent[d], c[d] + reach + 1) - begin[d];
    }
    for (std::int64_t i = 0; i < product(extent); ++i) {
      const std::int64_t v = linear_index(moved(coord_of(i, extent), begin, 1), image_.extent);
      if (image_.voxels[v] != own) continue;
      const std::atomic_ref<float> at(sizes[static_cast<std::size_t>(v)]);
      float seen = at.load(std::memory_order_relaxed);
      while ((seen == 0 || size < seen) && !at.compare_exchange_weak(seen, size, std::memory_order_relaxed)) {
      }
    }
  }

  const LabelImage<Dim>& image_;
  const Execution& execution_;
  std::vector<Step<Dim>> steps_;
  std::vector<float> depth_;
};

}  // namespace

template <int Dim>
std::vector<float> layer_sizes(const LabelImage<Dim>& image, int layers, double smallest, double largest,
                               const Execution& execution) {
  return Layers<Dim>(image, execution).sizes(layers, smallest, largest);
}

#define TREEMARCH_INSTANTIATE(DIM) \
  template std::vector<float> layer_sizes(const LabelImage<DIM>&, int, double, double, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
