#include "treemarch/topology/component_fates.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <optional>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/block_components.h"
#include "treemarch/topology/marked_blocks.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGlance = 16;  // every so manieth group of cells

/// Fates while they are found by several threads.
template <int Dim>
class Fates {
 public:
  Fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
        const MeshComponents<Dim>& components, const PlainBlocks<Dim>& plain, std::span<const MaterialId> to_image,
        const Execution& execution)
      : image_(image),
        map_(map),
        mesh_(mesh),
        components_(components),
        plain_(plain),
        to_image_(to_image),
        execution_(execution),
        centres_(image),
        missing_(image.labels.size(), 0) {
    fates_.of.resize(map.components.size());
    fates_.in_main.resize(map.components.size());
    for (const ImageComponent& c : map.components) ++missing_[c.material];
    const std::vector<std::int64_t> parts = components.count(execution);
    for (std::size_t m = 0; m < parts.size(); ++m) {
      // It may yet split: its cells are all looked at.
      if (to_image[m] != kOutside && parts[m] > 1) missing_[to_image[m]] = kMaySplit;
    }
  }

  ComponentFates find() {
    find_main();
    if (needs_plain_blocks(image_, mesh_))
      glance(1, [&](std::int64_t at) { return plain_[at] ? Look::at_first : Look::nowhere; });
    else
      glance(kGlance, [](std::int64_t) { return Look::at_all; });
    look_in_main();
    look_elsewhere();
    return std::move(fates_);
  }

 private:
  static constexpr std::int64_t kMaySplit = -1;
  /// A cell with what is looked up when it is needed.
  struct Cell {
    const MeshComponents<Dim>& components;
    std::size_t block;
    std::int64_t cell;
    MaterialId material;  // of the image
    std::uint32_t known = ComponentFate::kNone;
    std::uint32_t component() {
      if (known == ComponentFate::kNone) known = components.of(block, cell);
      return known;
    }
  };

  /// Calls visit(i, begin, end) for the i-th of every so manieth group of cells of a block.
  template <class Visit>
  void for_groups(std::size_t b, std::int64_t every, Visit&& visit) const {
    const std::int64_t n = mesh_.blocks[b].size();
    parallel_for(execution_, block_count(n, every * kCellsPerGroup), kGroupsPerTask, [&](std::int64_t i) {
      const std::int64_t begin = i * every * kCellsPerGroup;
      visit(static_cast<std::size_t>(i), begin, std::min(n, begin + kCellsPerGroup));
    });
  }
  /// Calls visit(cell) for those of a group whose material can tell more.
  template <class Visit>
  void for_open_cells(std::size_t b, std::int64_t begin, std::int64_t end, Visit&& visit) {
    for (std::int64_t c = begin; c < end; ++c) {
      const MaterialId material = to_image_[mesh_.blocks[b].materials[static_cast<std::size_t>(c)]];
      if (material == kOutside || missing(material) == 0) continue;
      Cell cell{components_, b, c, material};
      visit(cell);
    }
  }
  void find_main();
  template <class LookAt>
  void glance(std::int64_t every, LookAt&& look);
  void look_in_main();
  void look_elsewhere();

  /// Notes the components of the voxels in a cell. \param look a Look for each block of voxels
  template <class LookAt>
  void visit(Cell& cell, LookAt&& look) {
    for_each_simplex(mesh_, mesh_.blocks[cell.block], cell.cell, [&](const Simplex<Dim>& simplex) {
      centres_.visit(
          simplex, plain_.extent(), look,
          [&](std::int64_t v) { return image_.voxels[v] == cell.material && !covers(map_.of(v), cell); },
          [&](std::int64_t v) { widen(map_.of(v), cell); });
    });
  }
  [[nodiscard]] std::int64_t missing(MaterialId material) {
    return std::atomic_ref(missing_[material]).load(std::memory_order_relaxed);
  }
  [[nodiscard]] bool is_in_main(Cell& cell) const { return cell.component() == fates_.main[cell.material]; }
  /// Whether nothing is new if a component of the image has voxels in a cell.
  [[nodiscard]] bool covers(std::uint32_t c, Cell& cell) {
    ComponentFate& fate = fates_.of[c];
    return std::atomic_ref(fate.first).load(std::memory_order_relaxed) <= cell.component() &&
           std::atomic_ref(fate.last).load(std::memory_order_relaxed) >= cell.component() &&
           (!is_in_main(cell) || std::atomic_ref(fates_.in_main[c]).load(std::memory_order_relaxed) != 0);
  }
  void widen(std::uint32_t c, Cell& cell) {
    const std::uint32_t component = cell.component();
    const std::atomic_ref<std::uint32_t> first(fates_.of[c].first), last(fates_.of[c].last);
    std::uint32_t now = first.load(std::memory_order_relaxed);
    while (component < now && !first.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
    }
    const bool is_first = now == ComponentFate::kNone;
    now = last.load(std::memory_order_relaxed);
    while (component > now && !last.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
    }
    if (is_in_main(cell)) std::atomic_ref(fates_.in_main[c]).store(1, std::memory_order_relaxed);
    if (is_first && missing(cell.material) > 0)
      std::atomic_ref(missing_[cell.material]).fetch_sub(1, std::memory_order_relaxed);
  }

  const LabelImage<Dim>& image_;
  const ComponentMap& map_;
  const Mesh<Dim>& mesh_;
  const MeshComponents<Dim>& components_;
  const PlainBlocks<Dim>& plain_;
  std::span<const MaterialId> to_image_;
  const Execution& execution_;
  const VoxelCentres<Dim> centres_;
  ComponentFates fates_;
  std::vector<std::int64_t> missing_;  // of each material: components without a fate, or kMaySplit
};

/// Counts the components of some cells.
template <int Dim>
void Fates<Dim>::find_main() {
  struct Count {
    MaterialId material;
    std::uint32_t component;
    std::int64_t cells;
  };
  std::vector<Count> counts;
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
    std::vector<std::vector<Count>> found(
        static_cast<std::size_t>(block_count(mesh_.blocks[b].size(), kGlance * kCellsPerGroup)));
    for_groups(b, kGlance, [&](std::size_t i, std::int64_t begin, std::int64_t end) {
      auto& here = found[i];
      for_open_cells(b, begin, end, [&](Cell& cell) {
        if (here.empty() || here.back().component != cell.component())
          here.push_back({cell.material, cell.component(), 0});
        ++here.back().cells;
      });
    });
    for (const auto& here : found) counts.insert(counts.end(), here.begin(), here.end());
  }
  std::ranges::sort(counts, {}, [](const Count& c) { return std::pair(c.component, c.material); });
  fates_.main.assign(image_.labels.size(), ComponentFate::kNone);
  std::vector<std::int64_t> most(image_.labels.size(), 0);
  for (std::size_t i = 0; i < counts.size();) {
    const Count& first = counts[i];
    std::int64_t cells = 0;
    for (; i < counts.size() && counts[i].component == first.component; ++i) cells += counts[i].cells;
    if (cells <= most[first.material]) continue;
    most[first.material] = cells;
    fates_.main[first.material] = first.component;
  }
}

template <int Dim>
template <class LookAt>
void Fates<Dim>::glance(std::int64_t every, LookAt&& look) {
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
    for_groups(b, every, [&](std::size_t, std::int64_t begin, std::int64_t end) {
      for_open_cells(b, begin, end, [&](Cell& cell) { visit(cell, look); });
    });
}

/// At voxels of components that are not yet known to reach the main part of their material. Lists the cells of others.
template <int Dim>
void Fates<Dim>::look_in_main() {
  std::vector<std::uint8_t> undecided(map_.components.size()), has_undecided(image_.labels.size());
  for (std::size_t c = 0; c < undecided.size(); ++c) {
    const MaterialId m = map_.components[c].material;
    undecided[c] = fates_.main[m] != ComponentFate::kNone && fates_.in_main[c] == 0;
    has_undecided[m] |= undecided[c];
  }
  const MarkedBlocks<Dim> blocks(image_, map_, undecided, execution_);
  const bool large = needs_plain_blocks(image_, mesh_);
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
    std::vector<std::vector<CellPlace>> elsewhere(
        static_cast<std::size_t>(block_count(mesh_.blocks[b].size(), kCellsPerGroup)));
    for_groups(b, 1, [&](std::size_t i, std::int64_t begin, std::int64_t end) {
      std::optional<bool> touched;
      for_open_cells(b, begin, end, [&](Cell& cell) {
        if (!is_in_main(cell) && missing(cell.material) == kMaySplit) {
          elsewhere[i].push_back({static_cast<std::uint8_t>(b), cell.cell});
          return;
        }
        if (is_in_main(cell)) {
          if (has_undecided[cell.material] == 0) return;
          if (!touched) touched = blocks.touch(mesh_, mesh_.blocks[b], begin, end);
          if (!*touched) return;
        }
        visit(cell, [&](std::int64_t at) {
          return (large && plain_[at]) || (is_in_main(cell) && !blocks[at]) ? Look::nowhere : Look::at_all;
        });
      });
    });
    for (const auto& in_group : elsewhere)
      fates_.elsewhere.insert(fates_.elsewhere.end(), in_group.begin(), in_group.end());
  }
}

/// At blocks with components that are not yet known to reach the part of a cell: in most there are none.
template <int Dim>
void Fates<Dim>::look_elsewhere() {
  const std::vector<CellPlace>& cells = fates_.elsewhere;
  if (cells.empty()) return;
  std::vector<std::uint8_t> wanted(map_.components.size());
  for (std::size_t c = 0; c < wanted.size(); ++c) wanted[c] = missing(map_.components[c].material) == kMaySplit;
  const BlockComponents<Dim> where(image_, map_, wanted, execution_);
  const bool large = needs_plain_blocks(image_, mesh_);
  parallel_for(execution_, std::ssize(cells), kCellsPerGroup, [&](std::int64_t i) {
    const CellPlace& place = cells[static_cast<std::size_t>(i)];
    const MaterialId material = to_image_[mesh_.blocks[place.block].materials[static_cast<std::size_t>(place.cell)]];
    Cell cell{components_, place.block, place.cell, material};
    visit(cell, [&](std::int64_t at) {
      const auto is_new = [&](std::uint32_t c) { return map_.components[c].material == material && !covers(c, cell); };
      return (large && plain_[at]) || std::ranges::none_of(where[at], is_new) ? Look::nowhere : Look::at_all;
    });
  });
}

}  // namespace

template <int Dim>
bool needs_plain_blocks(const LabelImage<Dim>& image, const Mesh<Dim>& mesh) {
  constexpr std::int64_t kFewVoxels = 8;  // a cell
  return product(image.extent) > kFewVoxels * mesh.cell_count();
}

// A glance decides about most components: at the plain blocks where cells are large, at some of the cells where they
// are not. What is left are small components, whose voxels alone need to be looked at in the cells of the main part of
// a material, and other parts, where blocks tell which components may be near.
template <int Dim>
ComponentFates component_fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
                               const MeshComponents<Dim>& components, const PlainBlocks<Dim>& plain,
                               std::span<const MaterialId> to_image, const Execution& execution) {
  return Fates<Dim>(image, map, mesh, components, plain, to_image, execution).find();
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

#define TREEMARCH_INSTANTIATE(DIM)                                                                       \
  template bool needs_plain_blocks(const LabelImage<DIM>&, const Mesh<DIM>&);                            \
  template ComponentFates component_fates(const LabelImage<DIM>&, const ComponentMap&, const Mesh<DIM>&, \
                                          const MeshComponents<DIM>&, const PlainBlocks<DIM>&,           \
                                          std::span<const MaterialId>, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
