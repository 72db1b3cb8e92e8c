#include "treemarch/sizing/sizing.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/sizing/error_sizing.h"
#include "treemarch/sizing/grading.h"
#include "treemarch/sizing/lattice_cover.h"
#include "treemarch/sizing/layer_sizing.h"

namespace treemarch {
namespace {

/// Longest side of the cells of a level.
template <int Dim>
double longest_side(const SizedLattice<Dim>& sized, int level) {
  const Coord<Dim> cells = sized.pattern.cell_extent(level);
  double side = 0;
  for (int d = 0; d < Dim; ++d) side = std::max(side, cells[d] * sized.lattice.unit[d]);
  return side;
}

/// The sizes of a rule as levels.
class Levels {
 public:
  template <int Dim>
  Levels(const LabelImage<Dim>& image, const SizedLattice<Dim>& sized, const SizingRule& rule) {
    for (int l = 0; l <= sized.deepest_level; ++l) side_.push_back(longest_side(sized, l));
    interface_ = rule.min_size > 0 ? level_of(rule.min_size) : static_cast<std::uint8_t>(sized.deepest_level);
    material_.assign(image.labels.size(), rule.max_size > 0 ? level_of(rule.max_size) : std::uint8_t{0});
    for (std::size_t m = 0; m < std::min(material_.size(), rule.material_size.size()); ++m)
      if (rule.material_size[m] > 0) material_[m] = level_of(rule.material_size[m]);
    material_interface_.assign(material_.size(), interface_);
    for (std::size_t m = 0; m < std::min(material_.size(), rule.material_interface_size.size()); ++m)
      if (rule.material_interface_size[m] > 0) material_interface_[m] = level_of(rule.material_interface_size[m]);
    for (const SizingRule::Interface& i : rule.interface_size)
      pairs_.push_back({std::minmax(i.first, i.second), level_of(i.size)});
    std::stable_sort(pairs_.begin(), pairs_.end(),
                     [](const Pair& a, const Pair& b) { return a.materials < b.materials; });
  }

  /// The first level whose cells are not larger.
  [[nodiscard]] std::uint8_t level_of(double size) const {
    std::uint8_t l = 0;
    while (l + 1U < side_.size() && side_[l] > size * kSizeTolerance) ++l;
    return l;
  }
  [[nodiscard]] std::uint8_t material(MaterialId m) const { return material_[m]; }
  [[nodiscard]] std::uint8_t interface(MaterialId a, MaterialId b) const {
    if (!pairs_.empty()) {
      const std::pair<MaterialId, MaterialId> key = std::minmax(a, b);
      const auto at = std::lower_bound(pairs_.begin(), pairs_.end(), key,
                                       [](const Pair& p, const auto& k) { return p.materials < k; });
      if (at != pairs_.end() && at->materials == key) return at->level;
    }
    return std::max({material_interface_[a], material_interface_[b], material_[a], material_[b]});
  }

 private:
  struct Pair {
    std::pair<MaterialId, MaterialId> materials;
    std::uint8_t level;
  };
  std::vector<double> side_;  // of the cells of each level
  std::uint8_t interface_ = 0;
  std::vector<std::uint8_t> material_, material_interface_;
  std::vector<Pair> pairs_;
};

/// What each voxel demands.
/// \param sizes of voxels, in lists of one a voxel each, or empty; 0 demands nothing.
template <int Dim>
std::vector<std::uint8_t> voxel_levels(const LabelImage<Dim>& image, const Levels& levels,
                                       const std::array<std::span<const float>, 2>& sizes, const Execution& execution) {
  std::vector<std::uint8_t> result(static_cast<std::size_t>(image.voxels.size()));
  const std::int64_t row = image.extent[0];
  std::array<std::int64_t, Dim> stride{};
  for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) stride[d] = n;
  image.voxels.visit([&](const auto* voxels) {
    parallel_for(execution, image.voxels.size() / row, std::max<std::int64_t>(1, 16384 / row), [&](std::int64_t r) {
      Coord<Dim> c = coord_of(r * row, image.extent);
      for (std::int64_t i = r * row; i < (r + 1) * row; ++i, ++c[0]) {
        const auto own = voxels[i];
        std::uint8_t level = 0;
        bool inside = true;
        const auto look = [&](std::int64_t neighbour) {
          if (voxels[neighbour] == own) return;
          level = std::max(level, levels.interface(own, voxels[neighbour]));
          inside = false;
        };
        for (int d = 0; d < Dim; ++d) {
          if (c[d] > 0) look(i - stride[d]);
          if (c[d] + 1 < image.extent[d]) look(i + stride[d]);
        }
        if (inside) level = levels.material(own);
        for (const auto& list : sizes)
          if (!list.empty() && list[i] > 0) level = std::max(level, levels.level_of(list[i]));
        result[i] = level;
      }
    });
  });
  return result;
}

/// The largest entry among the voxels that each cell overlaps along one axis; the other axes stay as they are.
template <int Dim>
std::vector<std::uint8_t> to_cells(const std::vector<std::uint8_t>& in, const Coord<Dim>& extent, int axis,
                                   std::int32_t cells, const Execution& execution) {
  const AxisCover cover(extent[axis], cells);
  std::int64_t row = 1;
  for (int d = 0; d < axis; ++d) row *= extent[d];
  const auto rows = static_cast<std::int64_t>(in.size()) / row / extent[axis] * cells;
  std::vector<std::uint8_t> out(static_cast<std::size_t>(rows * row), 0);
  parallel_for(execution, rows, std::max<std::int64_t>(1, 16384 / row), [&](std::int64_t r) {
    const std::int64_t cell = r % cells;
    std::uint8_t* to = out.data() + r * row;
    for (std::int64_t v = cover.first_voxel(cell); v <= cover.last_voxel(cell + 1); ++v) {
      const std::uint8_t* from = in.data() + (r / cells * extent[axis] + v) * row;
      for (std::int64_t i = 0; i < row; ++i) to[i] = std::max(to[i], from[i]);
    }
  });
  return out;
}

}  // namespace

template <int Dim>
std::vector<std::uint8_t> required_levels(const LabelImage<Dim>& image, const SizedLattice<Dim>& lattice,
                                          const SizingRule& rule, const Execution& execution) {
  const Levels by_rule(image, lattice, rule);
  std::vector<float> layers;
  if (rule.layers > 0)
    layers = layer_sizes(image, rule.layers,
                         rule.layer_floor > 0 ? rule.layer_floor : longest_side(lattice, lattice.deepest_level),
                         longest_side(lattice, 0), execution);
  std::vector<std::uint8_t> levels = voxel_levels(image, by_rule, {rule.voxel_size, layers}, execution);
  Coord<Dim> extent = image.extent;
  for (int d = 0; d < Dim; ++d) {
    const std::int32_t cells = lattice.lattice.extent[d];
    if (cells == extent[d]) continue;
    levels = to_cells(levels, extent, d, cells, execution);
    extent[d] = cells;
  }
  if (rule.tolerance > 0) {
    const int last = rule.floor_size > 0 ? by_rule.level_of(rule.floor_size) : lattice.deepest_level;
    refine_by_error(image, lattice, rule.tolerance, last, levels, execution);
  }
  limit_growth(lattice, rule.grading, levels, execution);
  return levels;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                     \
  template std::vector<std::uint8_t> required_levels(const LabelImage<DIM>&, const SizedLattice<DIM>&, \
                                                     const SizingRule&, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
