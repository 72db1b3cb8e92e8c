#include "treemarch/topology/component_fates.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;

/// Fates while they are found by several threads.
template <int Dim>
class Fates {
 public:
  Fates(const ComponentMap& map, const MeshComponents<Dim>& components, std::size_t labels,
        std::span<const MaterialId> to_image, const Execution& execution)
      : map_(map), fates_(map.components.size()), missing_(labels, 0) {
    for (const ImageComponent& c : map.components) ++missing_[c.material];
    // In several components of the mesh a material may yet split: its cells are all looked at.
    const std::vector<std::int64_t> parts = components.count(execution);
    for (std::size_t m = 0; m < parts.size(); ++m)
      if (to_image[m] != kOutside && parts[m] > 1) missing_[to_image[m]] = -1;
  }

  /// Whether cells of a material can tell no more.
  [[nodiscard]] bool known(MaterialId material) {
    return std::atomic_ref(missing_[material]).load(std::memory_order_relaxed) == 0;
  }
  [[nodiscard]] bool covers(std::int64_t voxel, std::uint32_t component) { return covers(of(voxel), component); }
  /// What is known of a component of the image.
  [[nodiscard]] bool covers(ComponentFate& fate, std::uint32_t component) const {
    return std::atomic_ref(fate.first).load(std::memory_order_relaxed) <= component &&
           std::atomic_ref(fate.last).load(std::memory_order_relaxed) >= component;
  }
  void widen(std::int64_t voxel, MaterialId material, std::uint32_t component) {
    ComponentFate& fate = of(voxel);
    const std::atomic_ref<std::uint32_t> first(fate.first), last(fate.last);
    std::uint32_t now = first.load(std::memory_order_relaxed);
    while (component < now && !first.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
    }
    const bool is_first = now == ComponentFate::kNone;
    now = last.load(std::memory_order_relaxed);
    while (component > now && !last.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
    }
    const std::atomic_ref<std::int64_t> missing(missing_[material]);
    if (is_first && missing.load(std::memory_order_relaxed) > 0) missing.fetch_sub(1, std::memory_order_relaxed);
  }
  /// Of each material the component of the mesh that its largest component of the image is known to lie in, or kNone.
  [[nodiscard]] std::vector<std::uint32_t> main_parts() const {
    std::vector<std::uint32_t> parts(missing_.size(), ComponentFate::kNone);
    std::vector<std::int64_t> largest(missing_.size(), 0);
    for (std::size_t c = 0; c < fates_.size(); ++c) {
      const ImageComponent& component = map_.components[c];
      if (fates_[c].lost() || component.voxels <= largest[component.material]) continue;
      largest[component.material] = component.voxels;
      parts[component.material] = fates_[c].first;
    }
    return parts;
  }
  [[nodiscard]] std::vector<ComponentFate> take() { return std::move(fates_); }

  [[nodiscard]] ComponentFate& of_component(std::uint32_t component) { return fates_[component]; }

 private:
  [[nodiscard]] ComponentFate& of(std::int64_t voxel) { return fates_[map_.of(voxel)]; }

  const ComponentMap& map_;
  std::vector<ComponentFate> fates_;
  std::vector<std::int64_t> missing_;  // of each material: components without a fate, or -1: not counted
};

/// Whether a component of the image is not known to reach the main part of its material.
template <int Dim>
bool is_undecided(const ComponentMap& map, Fates<Dim>& fates, std::span<const std::uint32_t> main, std::uint32_t c) {
  const std::uint32_t part = main[map.components[c].material];
  return part != ComponentFate::kNone && !fates.covers(fates.of_component(c), part);
}

/// Marks the blocks with voxels of undecided components of the image.
template <int Dim>
std::vector<std::uint8_t> undecided_blocks(const LabelImage<Dim>& image, const ComponentMap& map, Fates<Dim>& fates,
                                           std::span<const std::uint32_t> main, const Coord<Dim>& blocks,
                                           const Execution& execution) {
  constexpr std::int64_t kRowsPerTask = 256;
  std::vector<std::uint8_t> marks(static_cast<std::size_t>(product(blocks)));
  parallel_for(execution, std::ssize(map.row_begin) - 1, kRowsPerTask, [&](std::int64_t row) {
    const Coord<Dim> block = UniformBlocks<Dim>::block_of(coord_of(row * map.width, image.extent));
    std::uint8_t* const of_row = marks.data() + linear_index(block, blocks);
    map.for_runs(static_cast<std::size_t>(row), [&](std::int64_t begin, std::int64_t end, std::uint32_t component) {
      if (!is_undecided(map, fates, main, component)) return;
      for (std::int64_t b = begin >> UniformBlocks<Dim>::kShift; b <= (end - 1) >> UniformBlocks<Dim>::kShift; ++b)
        std::atomic_ref(of_row[b]).store(1, std::memory_order_relaxed);
    });
  });
  return marks;
}

}  // namespace

template <int Dim>
bool needs_plain_blocks(const LabelImage<Dim>& image, const Mesh<Dim>& mesh) {
  constexpr std::int64_t kFewVoxels = 4;  // a cell
  return product(image.extent) > kFewVoxels * mesh.cell_count();
}

// A glance decides about most components: at the plain blocks where cells are large, at some of the cells where they
// are not. What is left are small components, whose voxels alone need to be looked at in the cells of the main part of
// a material, and other parts.
template <int Dim>
std::vector<ComponentFate> component_fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
                                           const MeshComponents<Dim>& components, const PlainBlocks<Dim>& plain,
                                           std::span<const MaterialId> to_image, const Execution& execution) {
  constexpr std::int64_t kGlance = 16;  // every so manieth task of cells
  Fates<Dim> fates(map, components, image.labels.size(), to_image, execution);
  const VoxelCentres<Dim> centres(image);
  const auto look_at_cells = [&](std::int64_t every, auto&& skip, auto&& look) {
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
      const CellBlock& block = mesh.blocks[b];
      const auto look_at_cell = [&](std::int64_t c) {
        const MaterialId material = to_image[block.materials[static_cast<std::size_t>(c)]];
        if (material == kOutside || fates.known(material)) return;
        std::uint32_t found = ComponentFate::kNone;
        const auto component = [&] {  // looked up when it is needed
          if (found == ComponentFate::kNone) found = components.of(b, c);
          return found;
        };
        if (skip(material, component)) return;
        for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
          centres.visit(
              simplex, plain.extent(), [&](std::int64_t at) { return look(at, material, component); },
              [&](std::int64_t v) { return image.voxels[v] == material && !fates.covers(v, component()); },
              [&](std::int64_t v) { fates.widen(v, material, component()); });
        });
      };
      parallel_for(execution, block_count(block.size(), every * kCellsPerTask), 1, [&](std::int64_t task) {
        const std::int64_t begin = task * every * kCellsPerTask;
        for (std::int64_t c = begin; c < std::min(block.size(), begin + kCellsPerTask); ++c) look_at_cell(c);
      });
    }
  };
  const auto none = [](MaterialId, auto&&) { return false; };
  const bool large = needs_plain_blocks(image, mesh);
  if (large)
    look_at_cells(1, none,
                  [&](std::int64_t at, MaterialId, auto&&) { return plain[at] ? Look::at_first : Look::nowhere; });
  else
    look_at_cells(kGlance, none, [&](std::int64_t, MaterialId, auto&&) { return Look::at_all; });
  const std::vector<std::uint32_t> main = fates.main_parts();
  const std::vector<std::uint8_t> blocks = undecided_blocks(image, map, fates, main, plain.extent(), execution);
  std::vector<std::uint8_t> undecided(main.size(), 0);  // of each material: whether a component is
  for (std::uint32_t c = 0; c < map.components.size(); ++c)
    undecided[map.components[c].material] |= static_cast<std::uint8_t>(is_undecided(map, fates, main, c));
  look_at_cells(
      1,
      [&](MaterialId material, auto&& component) { return undecided[material] == 0 && component() == main[material]; },
      [&](std::int64_t at, MaterialId material, auto&& component) {
        if (large && plain[at]) return Look::nowhere;
        const bool decided = blocks[static_cast<std::size_t>(at)] == 0 && component() == main[material];
        return decided ? Look::nowhere : Look::at_all;
      });
  return fates.take();
}

std::vector<MaterialId> match_labels(const std::vector<std::int32_t>& mesh, const std::vector<std::int32_t>& image) {
  std::vector<MaterialId> by_value(image.size());
  std::iota(by_value.begin(), by_value.end(), 0U);
  const auto value = [&](MaterialId m) { return image[m]; };
  std::ranges::sort(by_value, {}, value);
  std::vector<MaterialId> match;
  for (const std::int32_t label : mesh) {
    const auto at = std::ranges::lower_bound(by_value, label, {}, value);
    match.push_back(at != by_value.end() && image[*at] == label ? *at : kOutside);
  }
  return match;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                   \
  template bool needs_plain_blocks(const LabelImage<DIM>&, const Mesh<DIM>&);                                        \
  template std::vector<ComponentFate> component_fates(const LabelImage<DIM>&, const ComponentMap&, const Mesh<DIM>&, \
                                                      const MeshComponents<DIM>&, const PlainBlocks<DIM>&,           \
                                                      std::span<const MaterialId>, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
