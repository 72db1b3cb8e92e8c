#include "treemarch/field/thin.h"

#include <array>
#include <atomic>
#include <bit>
#include <cstdlib>

#include "treemarch/core/parallel.h"

namespace treemarch {

namespace {

/// One bit a voxel, a word a brick.
using Mask = std::vector<std::uint64_t>;

template <int Dim>
class Thinness {
 public:
  Thinness(const LabelImage<Dim>& image, const VoxelLists<Dim>& lists, const Mask& flagged, const Execution& execution)
      : image_(image), lists_(lists), flagged_(flagged), execution_(execution) {}

  [[nodiscard]] Mask seeds() const {
    return select(flagged_, [this](const Coord<Dim>& c) {
      return !any_neighbour(
          c, [&](const Coord<Dim>& n) { return !has(flagged_, n) && image_.material(n) == image_.material(c); });
    });
  }

  /// `set` and the flagged voxels of the same label beside it.
  [[nodiscard]] Mask grown(const Mask& set) const {
    return select(flagged_, [&](const Coord<Dim>& c) {
      return has(set, c) || any_neighbour(c, [&](const Coord<Dim>& n) {
               return has(set, n) && image_.material(n) == image_.material(c);
             });
    });
  }

  /// Flagged voxels whose neighbours of the same label hang together only through them.
  [[nodiscard]] Mask bridges() const {
    return select(flagged_, [&](const Coord<Dim>& c) {
      std::uint32_t around = 0;
      const MaterialId own = image_.material(c);
      any_neighbour(c, [&](const Coord<Dim>& n) {
        if (image_.material(n) == own) around |= std::uint32_t{1} << place_around(c, n);
        return false;
      });
      return !connected(around);
    });
  }

  [[nodiscard]] Mask with_ring(const Mask& set) const {
    Mask result = set;
    for_each(set, [&](const Coord<Dim>& c) {
      any_neighbour(c, [&](const Coord<Dim>& n) {
        std::atomic_ref<std::uint64_t> word(result[lists_.brick_of(n)]);
        word.fetch_or(bit(n), std::memory_order_relaxed);
        return false;
      });
    });
    return result;
  }

  /// How many of the voxels that share a face with c have its label; beyond the image counts as its label.
  [[nodiscard]] int face_neighbours(const Coord<Dim>& c) const {
    int count = 0;
    for (int d = 0; d < Dim; ++d)
      for (const int step : {-1, 1}) {
        Coord<Dim> n = c;
        n[d] += step;
        count += n[d] < 0 || n[d] >= image_.extent[d] || image_.material(n) == image_.material(c);
      }
    return count;
  }

  /// Calls f(voxel) for every voxel of a set, in parallel by bricks.
  template <class F>
  void for_each(const Mask& mask, F&& f) const {
    parallel_for(execution_, static_cast<std::int64_t>(mask.size()), 256, [&](std::int64_t brick) {
      for_each_in_brick(mask, brick, [&](const Coord<Dim>& c, std::uint64_t) { f(c); });
    });
  }

 private:
  static constexpr int kPlaces = Dim == 3 ? 27 : 9;

  /// Index of a neighbour among the 3^Dim places around c.
  static int place_around(const Coord<Dim>& c, const Coord<Dim>& n) {
    int place = 0;
    for (int d = Dim; d-- > 0;) place = 3 * place + n[d] - c[d] + 1;
    return place;
  }

  /// Whether the given places around a voxel hang together over faces, edges and corners.
  static bool connected(std::uint32_t places) {
    static const std::array<std::uint32_t, kPlaces> touching = [] {
      std::array<std::uint32_t, kPlaces> t{};
      for (int a = 0; a < kPlaces; ++a)
        for (int b = 0; b < kPlaces; ++b) {
          bool near = true;
          for (int d = 0, p = a, q = b; d < Dim; ++d, p /= 3, q /= 3) near &= std::abs(p % 3 - q % 3) <= 1;
          if (near) t[a] |= std::uint32_t{1} << b;
        }
      return t;
    }();
    std::uint32_t reached = places & -places;
    for (std::uint32_t before = 0; before != reached;) {
      before = reached;
      for (std::uint32_t rest = before; rest != 0; rest &= rest - 1) reached |= touching[std::countr_zero(rest)];
      reached &= places;
    }
    return reached == places;
  }

  static std::uint64_t bit(const Coord<Dim>& c) { return std::uint64_t{1} << VoxelLists<Dim>::place_in_brick(c); }
  bool has(const Mask& mask, const Coord<Dim>& c) const { return (mask[lists_.brick_of(c)] & bit(c)) != 0; }

  /// Calls f for the neighbours of c until it is true of one.
  template <class F>
  bool any_neighbour(const Coord<Dim>& c, F&& f) const {
    for (int i = 0; i < kPlaces; ++i) {
      Coord<Dim> n = c;
      bool inside = i != kPlaces / 2;
      for (int d = 0, rest = i; d < Dim; ++d, rest /= 3) {
        n[d] += rest % 3 - 1;
        inside &= n[d] >= 0 && n[d] < image_.extent[d];
      }
      if (inside && f(n)) return true;
    }
    return false;
  }

  template <class F>
  void for_each_in_brick(const Mask& mask, std::int64_t brick, F&& f) const {
    constexpr int kShift = VoxelLists<Dim>::kShift;
    if (mask[brick] == 0) return;
    const Coord<Dim> corner = coord_of(brick, lists_.brick_extent);
    for (std::uint64_t rest = mask[brick]; rest != 0; rest &= rest - 1) {
      const int place = std::countr_zero(rest);
      Coord<Dim> c{};
      for (int d = 0; d < Dim; ++d)
        c[d] = (corner[d] << kShift) | (place >> (d * kShift) & (VoxelLists<Dim>::kSide - 1));
      f(c, rest & -rest);
    }
  }

  template <class F>
  Mask select(const Mask& mask, F&& f) const {
    Mask result(mask.size(), 0);
    parallel_for(execution_, static_cast<std::int64_t>(mask.size()), 256, [&](std::int64_t brick) {
      for_each_in_brick(mask, brick, [&](const Coord<Dim>& c, std::uint64_t place) {
        if (f(c)) result[brick] |= place;
      });
    });
    return result;
  }

  const LabelImage<Dim>& image_;
  const VoxelLists<Dim>& lists_;
  const Mask& flagged_;
  const Execution& execution_;
};

/// Weight of the own label of a thin voxel by its face neighbours of that label. Between flat cells a wire or a grain
/// would lose most of its volume: the fewer neighbours, the farther out the interface is put.
template <int Dim>
std::uint32_t thin_weight(int neighbours) {
  constexpr std::array<double, 5> kWeight = {1.9, 1.6, 1.3, 1.1, 1};
  const int missing = std::max(0, 2 * (Dim - 1) - neighbours);  // none in a sheet
  return static_cast<std::uint32_t>(kWeight[static_cast<std::size_t>(4 - std::min(4, missing))] *
                                    VoxelLists<Dim>::kOne);
}

}  // namespace

template <int Dim>
std::int64_t keep_thin(const LabelImage<Dim>& image, const std::vector<std::uint64_t>& flagged, VoxelLists<Dim>& lists,
                       const Execution& execution) {
  const Thinness<Dim> thinness(image, lists, flagged, execution);
  Mask thin = thinness.seeds();
  for (int step = 0; step < 2; ++step) thin = thinness.grown(thin);
  const Mask bridges = thinness.bridges();
  for (std::size_t b = 0; b < thin.size(); ++b) thin[b] |= bridges[b];
  const Mask raw = thinness.with_ring(thin);
  thinness.for_each(raw, [&](const Coord<Dim>& c) {
    lists.make_raw(lists.refs[lists.brick_of(c)], VoxelLists<Dim>::place_in_brick(c), VoxelLists<Dim>::kOne);
  });
  thinness.for_each(thin, [&](const Coord<Dim>& c) {
    lists.make_raw(lists.refs[lists.brick_of(c)], VoxelLists<Dim>::place_in_brick(c),
                   thin_weight<Dim>(thinness.face_neighbours(c)));
  });
  std::int64_t count = 0;
  for (std::uint64_t word : raw) count += std::popcount(word);
  return count;
}

template std::int64_t keep_thin(const LabelImage<2>&, const std::vector<std::uint64_t>&, VoxelLists<2>&,
                                const Execution&);
template std::int64_t keep_thin(const LabelImage<3>&, const std::vector<std::uint64_t>&, VoxelLists<3>&,
                                const Execution&);

}  // namespace treemarch
