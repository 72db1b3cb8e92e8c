#include "treemarch/sizing/sizing.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"
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

/// What voxels demand of the cells that they overlap.
template <int Dim>
class Demand {
 public:
  /// \param sizes of voxels, in lists of one a voxel each, or empty; 0 demands nothing.
  Demand(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const Levels& levels,
         const std::array<std::span<const float>, 2>& sizes, const Coord<Dim>& cells)
      : image_(image), uniform_(uniform), levels_(levels), sizes_(sizes), cells_(cells) {
    for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) {
      stride_[d] = n;
      const AxisCover cells_of(cells[d], image.extent[d]);  // the voxels cover cells as cells do voxels
      for (std::int32_t v = 0; v < image.extent[d]; ++v)
        spans_[d].push_back({cells_of.first_voxel(v), cells_of.last_voxel(v + 1) + 1});
    }
  }

  /// Raises the level of each cell to the highest that is demanded of it, and to that of single voxels.
  void raise(std::vector<std::uint8_t>& levels, std::span<const SizingRule::Voxel> few,
             const Execution& execution) const {
    // By layers of cells, so that no two threads write to one of them.
    constexpr int kLast = Dim - 1;
    const AxisCover cover(image_.extent[kLast], cells_[kLast]);
    const std::int64_t per_task =
        std::max<std::int64_t>(1, UniformBlocks<Dim>::kSide * cover.cells / std::max<std::int64_t>(1, cover.voxels));
    parallel_for(execution, block_count(cover.cells, per_task), 1, [&](std::int64_t task) {
      Layers layers{static_cast<std::int32_t>(task * per_task),
                    static_cast<std::int32_t>(std::min(cover.cells, (task + 1) * per_task)),
                    levels.data(),
                    {}};
      const std::int32_t first = cover.first_voxel(layers.begin), last = cover.last_voxel(layers.end);
      VoxelBox<Dim> blocks{{}, uniform_.extent()};
      blocks.begin[kLast] = first >> UniformBlocks<Dim>::kShift;
      blocks.end[kLast] = (last >> UniformBlocks<Dim>::kShift) + 1;
      for_each_row(blocks, uniform_.extent(), [&](Coord<Dim> block, std::int64_t) {
        VoxelBox<Dim> all, mixed;  // of the row; of its last blocks, which are looked at together
        for (; block[0] < blocks.end[0]; ++block[0]) {
          VoxelBox<Dim> box = voxels_of_block(block, image_.extent);
          box.begin[kLast] = std::max(box.begin[kLast], first);
          box.end[kLast] = std::min(box.end[kLast], last + 1);
          add_behind(all, box);
          const MaterialId material = material_around(box);
          if (material == UniformBlocks<Dim>::kMixed) {
            add_behind(mixed, box);
            continue;
          }
          raise_to(box, levels_.material(material), layers);
          raise_by_voxels(mixed, layers);
          mixed = {};
        }
        raise_by_voxels(mixed, layers);
        for (const std::span<const float> list : sizes_)
          if (!list.empty()) raise_by_sizes(all, list, layers);
      });
    });
    const Layers all{0, cells_[kLast], levels.data(), {}};
    for (const auto& [voxel, size] : few)
      raise_to(one_voxel(coord_of(voxel, image_.extent)), levels_.level_of(size), all);
  }

 private:
  struct Span {
    std::int32_t begin, end;  // cells
  };
  /// Cells of some layers along the last axis.
  struct Layers {
    std::int32_t begin, end;
    std::uint8_t* levels;           // of all cells
    std::vector<std::uint8_t> row;  // scratch: demanded along the first axis
  };

  /// That of a box and one voxel more on either side.
  MaterialId material_around(const VoxelBox<Dim>& box) const {
    Coord<Dim> around = box.begin;
    for (auto& c : around) c = std::max(0, c - 1);
    return uniform_.within(around, box.end);
  }
  static void add_behind(VoxelBox<Dim>& boxes, const VoxelBox<Dim>& next) {
    if (boxes.is_empty()) boxes = next;
    boxes.end[0] = next.end[0];
  }

  void raise_by_voxels(const VoxelBox<Dim>& box, Layers& layers) const {
    if (!box.is_empty()) image_.voxels.visit([&](const auto* voxels) { raise_by_voxels(box, voxels, layers); });
  }
  template <class T>
  void raise_by_voxels(const VoxelBox<Dim>& box, const T* voxels, Layers& layers) const {
    const std::int32_t width = box.end[0] - box.begin[0];
    // Of each voxel of a row: 0 where all neighbours are of the same material.
    std::vector<T> differs(static_cast<std::size_t>(width));
    for_each_row(box, image_.extent, [&](const Coord<Dim>& c, std::int64_t at) {
      const T* const row = voxels + at;
      // A voxel stands for the neighbours that it does not have.
      std::array<std::int64_t, 2 * Dim> steps{};
      for (int d = 1; d < Dim; ++d) {
        if (c[d] > 0) steps[2 * d] = -stride_[d];
        if (c[d] + 1 < image_.extent[d]) steps[2 * d + 1] = stride_[d];
      }
      std::ranges::fill(differs, T{0});
      const auto compare = [&](std::int32_t begin, std::int32_t end, std::int64_t step) {
        for (std::int32_t k = begin; k < end; ++k) differs[k] = static_cast<T>(differs[k] | (row[k] ^ row[k + step]));
      };
      for (std::size_t s = 2; s < steps.size(); ++s) compare(0, width, steps[s]);
      compare(c[0] > 0 ? 0 : 1, width, -1);
      compare(0, box.end[0] < image_.extent[0] ? width : width - 1, 1);

      VoxelBox<Dim> voxels_of_row{c, c};
      for (int d = 0; d < Dim; ++d) voxels_of_row.end[d] = d == 0 ? box.end[0] : c[d] + 1;
      const VoxelBox<Dim> cells = cells_of(voxels_of_row, layers);
      layers.row.assign(static_cast<std::size_t>(cells.end[0] - cells.begin[0]), 0);
      for (std::int32_t k = 0; k < width; ++k) {
        std::uint8_t level = 0;
        if (differs[k] == 0) {
          level = levels_.material(row[k]);
        } else {
          steps[0] = c[0] + k > 0 ? -1 : 0;
          steps[1] = c[0] + k + 1 < image_.extent[0] ? 1 : 0;
          for (const std::int64_t step : steps)
            if (row[k + step] != row[k]) level = std::max(level, levels_.interface(row[k], row[k + step]));
        }
        if (level == 0) continue;
        const auto [begin, end] = spans_[0][c[0] + k];
        for (std::int32_t x = std::max(begin, cells.begin[0]); x < std::min(end, cells.end[0]); ++x) {
          std::uint8_t& here = layers.row[static_cast<std::size_t>(x - cells.begin[0])];
          here = std::max(here, level);
        }
      }
      for_each_row(cells, cells_, [&](const Coord<Dim>&, std::int64_t first) {
        std::uint8_t* const to = layers.levels + first;
        for (std::size_t x = 0; x < layers.row.size(); ++x) to[x] = std::max(to[x], layers.row[x]);
      });
    });
  }
  void raise_by_sizes(const VoxelBox<Dim>& box, std::span<const float> sizes, const Layers& layers) const {
    for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t i) {
      for (; c[0] < box.end[0]; ++c[0], ++i)
        if (const float size = sizes[static_cast<std::size_t>(i)]; size > 0)
          raise_to(one_voxel(c), levels_.level_of(size), layers);
    });
  }
  static VoxelBox<Dim> one_voxel(const Coord<Dim>& voxel) {
    VoxelBox<Dim> box{voxel, voxel};
    for (auto& c : box.end) ++c;
    return box;
  }

  /// All cells of some layers that a box of voxels overlaps.
  VoxelBox<Dim> cells_of(const VoxelBox<Dim>& voxels, const Layers& layers) const {
    VoxelBox<Dim> cells;
    for (int d = 0; d < Dim; ++d) {
      cells.begin[d] = spans_[d][static_cast<std::size_t>(voxels.begin[d])].begin;
      cells.end[d] = spans_[d][static_cast<std::size_t>(voxels.end[d] - 1)].end;
    }
    cells.begin[Dim - 1] = std::max(cells.begin[Dim - 1], layers.begin);
    cells.end[Dim - 1] = std::min(cells.end[Dim - 1], layers.end);
    return cells;
  }
  void raise_to(const VoxelBox<Dim>& voxels, std::uint8_t level, const Layers& layers) const {
    const VoxelBox<Dim> cells = cells_of(voxels, layers);
    for_each_row(cells, cells_, [&](const Coord<Dim>& c, std::int64_t at) {
      for (std::int64_t i = at; i < at + cells.end[0] - c[0]; ++i) layers.levels[i] = std::max(layers.levels[i], level);
    });
  }

  const LabelImage<Dim>& image_;
  const UniformBlocks<Dim>& uniform_;
  const Levels& levels_;
  const std::array<std::span<const float>, 2>& sizes_;
  const Coord<Dim> cells_;
  std::array<std::int64_t, Dim> stride_{};
  std::array<std::vector<Span>, Dim> spans_;  // cells that each voxel overlaps, by axis
};

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
  std::vector<std::uint8_t> levels(static_cast<std::size_t>(product(lattice.lattice.extent)));
  const std::array<std::span<const float>, 2> sizes{rule.voxel_size, layers};
  const UniformBlocks<Dim> uniform(image, execution);
  Demand<Dim>(image, uniform, by_rule, sizes, lattice.lattice.extent).raise(levels, rule.few_voxels, execution);
  if (rule.tolerance > 0) {
    const int last = rule.floor_size > 0 ? by_rule.level_of(rule.floor_size) : lattice.deepest_level;
    refine_by_error(image, uniform, lattice, rule.tolerance, last, levels, execution);
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
