#include "treemarch/report/interface_distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

constexpr std::int64_t kFacetsPerPart = 4096;

/// Sums over the facets between two materials of the image.
template <int Dim>
struct PairSum {
  MaterialId a = 0, b = 0;  // ascending
  double area = 0, near_area = 0, squares = 0, max = -1;
  Vec<Dim> max_point{};
  [[nodiscard]] bool same(const PairSum& other) const { return a == other.a && b == other.b; }
  void add(const PairSum& other) {
    area += other.area;
    near_area += other.near_area;
    squares += other.squares;
    if (other.max > max) max = other.max, max_point = other.max_point;
  }
};

/// Distances to faces between voxels of two materials.
template <int Dim>
class FaceSearch {
 public:
  explicit FaceSearch(const LabelImage<Dim>& image) : image_(image) {
    smallest_ = image.frame.spacing[0];
    for (const double h : image.frame.spacing) smallest_ = std::min(smallest_, h);
    for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) stride_[d] = n;
  }

  /// Infinite if there is none within kReach voxels.
  [[nodiscard]] double distance(const Vec<Dim>& x, MaterialId a, MaterialId b) const {
    Coord<Dim> corner{};  // of voxels, the nearest one
    for (int d = 0; d < Dim; ++d) corner[d] = static_cast<std::int32_t>(std::lround(x[d] / image_.frame.spacing[d]));
    double best = std::numeric_limits<double>::infinity();  // squared
    for (int reach = 1; reach <= kReach; ++reach) {
      search(x, corner, reach, a, b, best);
      // Faces further out are beyond the block that was searched.
      const double sure = (reach - 0.5) * smallest_;
      if (best <= sure * sure) break;
    }
    return std::sqrt(best);
  }

 private:
  /// Faces inside the block of 2 reach voxels a side about a corner.
  void search(const Vec<Dim>& x, const Coord<Dim>& corner, int reach, MaterialId a, MaterialId b, double& best) const {
    VoxelBox<Dim> box;
    for (int d = 0; d < Dim; ++d) {
      box.begin[d] = std::max(0, corner[d] - reach);
      box.end[d] = std::min(image_.extent[d], corner[d] + reach);
    }
    if (box.is_empty()) return;
    image_.voxels.visit([&](const auto* voxels) {
      for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t at) {
        for (; c[0] < box.end[0]; ++c[0], ++at) {
          const MaterialId here = voxels[at];
          if (here != a && here != b) continue;
          const MaterialId other = here == a ? b : a;
          for (int d = 0; d < Dim; ++d)
            if (c[d] + 1 < box.end[d] && voxels[at + stride_[d]] == other)
              best = std::min(best, squared_to_face(x, c, d));
        }
      });
    });
  }

  /// To the upper face of a voxel across an axis.
  [[nodiscard]] double squared_to_face(const Vec<Dim>& x, const Coord<Dim>& voxel, int axis) const {
    double sum = 0;
    for (int d = 0; d < Dim; ++d) {
      const double h = image_.frame.spacing[d];
      const double from = d == axis ? (voxel[d] + 1) * h : voxel[d] * h, to = (voxel[d] + 1) * h;
      const double off = x[d] < from ? from - x[d] : x[d] > to ? x[d] - to : 0;
      sum += off * off;
    }
    return sum;
  }

  const LabelImage<Dim>& image_;
  std::array<std::int64_t, Dim> stride_{};
  double smallest_ = 1;
};

template <int Dim>
double facet_area(const Points<Dim>& points, const LocalFacet& facet, const VertexId* cell) {
  const auto p = [&](int k) { return points[cell[facet.vertex[static_cast<std::size_t>(k)]]]; };
  if constexpr (Dim == 2) {
    return norm(p(1) - p(0));
  } else {
    double area = 0.5 * norm(cross(p(1) - p(0), p(2) - p(0)));
    if (facet.size == 4) area += 0.5 * norm(cross(p(2) - p(0), p(3) - p(0)));
    return area;
  }
}

/// Whether all vertices of a facet lie on one side of the box of an image.
template <int Dim>
bool on_box(const Points<Dim>& points, const LocalFacet& facet, const VertexId* cell, const Vec<Dim>& box) {
  for (int d = 0; d < Dim; ++d)
    for (const double side : {0.0, box[d]}) {
      bool on = true;
      for (int k = 0; k < facet.size; ++k)
        on &= std::abs(points[cell[facet.vertex[static_cast<std::size_t>(k)]]][d] - side) <= 1e-6 * box[d];
      if (on) return true;
    }
  return false;
}

/// The sum for a pair, which is added if it is new. Neighbouring facets mostly belong to the same pair.
template <int Dim>
PairSum<Dim>& sum_of(std::vector<PairSum<Dim>>& sums, MaterialId a, MaterialId b) {
  for (auto s = sums.rbegin(); s != sums.rend(); ++s)
    if (s->a == a && s->b == b) return *s;
  sums.push_back({a, b});
  return sums.back();
}

}  // namespace

template <int Dim>
std::vector<InterfaceFidelity> measure_interfaces(const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                                                  std::span<const MaterialId> to_image, std::int32_t background,
                                                  std::span<const BorderFacet> borders, const Execution& execution) {
  const MaterialId nothing = material_of(image.labels, background);
  const Vec<Dim> box = image.size();
  const FaceSearch<Dim> search(image);
  const auto facets = static_cast<std::int64_t>(borders.size());
  std::vector<std::vector<PairSum<Dim>>> parts(static_cast<std::size_t>(block_count(facets, kFacetsPerPart)));
  const auto measure = [&](const BorderFacet& border, std::vector<PairSum<Dim>>& sums) {
    const CellBlock& block = mesh.blocks[border.side.block];
    MaterialId a = to_image[block.materials[static_cast<std::size_t>(border.side.cell)]];
    MaterialId b = border.beyond == kOutside ? nothing : to_image[border.beyond];
    if (a == b || a == kOutside || b == kOutside) return;
    const LocalFacet& facet = topology(block.type).facets[border.side.facet];
    const VertexId* cell = block.cell(border.side.cell);
    if (border.beyond == kOutside && on_box(mesh.points, facet, cell, box)) return;
    if (a > b) std::swap(a, b);
    Vec<Dim> middle{};
    for (int k = 0; k < facet.size; ++k)
      middle = middle + (1.0 / facet.size) * mesh.points[cell[facet.vertex[static_cast<std::size_t>(k)]]];
    PairSum<Dim> one{a, b, facet_area(mesh.points, facet, cell)};
    const double distance = search.distance(middle, a, b);
    if (std::isfinite(distance)) {
      one.near_area = one.area;
      one.squares = one.area * distance * distance;
      one.max = distance;
      one.max_point = middle;
    }
    sum_of(sums, a, b).add(one);
  };
  parallel_for(execution, std::ssize(parts), 1, [&](std::int64_t p) {
    const std::int64_t last = std::min(facets, (p + 1) * kFacetsPerPart);
    for (std::int64_t i = p * kFacetsPerPart; i < last; ++i)
      measure(borders[static_cast<std::size_t>(i)], parts[static_cast<std::size_t>(p)]);
  });

  std::vector<PairSum<Dim>> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  std::ranges::stable_sort(all, [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
  std::vector<InterfaceFidelity> interfaces;
  for (std::size_t i = 0; i < all.size();) {
    PairSum<Dim> sum = all[i];
    while (++i < all.size() && all[i].same(sum)) sum.add(all[i]);
    InterfaceFidelity f;
    f.first = std::min(image.labels[sum.a], image.labels[sum.b]);
    f.second = std::max(image.labels[sum.a], image.labels[sum.b]);
    f.area = sum.area;
    f.far_area = sum.area - sum.near_area;
    if (sum.near_area > 0) {
      f.rms = std::sqrt(sum.squares / sum.near_area);
      f.max = sum.max;
      const Vec<Dim> place = to_world(image.frame, sum.max_point);
      for (int d = 0; d < Dim; ++d) f.max_place[d] = place[d];
    }
    interfaces.push_back(f);
  }
  std::ranges::sort(interfaces, {}, [](const InterfaceFidelity& f) { return std::pair(f.first, f.second); });
  return interfaces;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                      \
  template std::vector<InterfaceFidelity> measure_interfaces(const LabelImage<DIM>&, const Mesh<DIM>&,  \
                                                             std::span<const MaterialId>, std::int32_t, \
                                                             std::span<const BorderFacet>, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
