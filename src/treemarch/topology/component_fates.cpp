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
  [[nodiscard]] bool covers(std::int64_t voxel, std::uint32_t component) {
    ComponentFate& fate = of(voxel);
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
  [[nodiscard]] std::vector<ComponentFate> take() { return std::move(fates_); }

 private:
  [[nodiscard]] ComponentFate& of(std::int64_t voxel) { return fates_[map_.of(voxel)]; }

  const ComponentMap& map_;
  std::vector<ComponentFate> fates_;
  std::vector<std::int64_t> missing_;  // of each material: components without a fate, or -1: not counted
};

}  // namespace

template <int Dim>
std::vector<ComponentFate> component_fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
                                           const MeshComponents<Dim>& components, const PlainBlocks<Dim>& plain,
                                           std::span<const MaterialId> to_image, const Execution& execution) {
  Fates<Dim> fates(map, components, image.labels.size(), to_image, execution);
  const VoxelCentres<Dim> centres(image);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    parallel_for(execution, block.size(), kCellsPerTask, [&](std::int64_t c) {
      const MaterialId material = to_image[block.materials[static_cast<std::size_t>(c)]];
      if (material == kOutside || fates.known(material)) return;
      std::uint32_t component = ComponentFate::kNone;  // looked up when it is needed
      for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
        centres.visit(
            simplex, plain,
            [&](std::int64_t v) {
              if (image.voxels[v] != material) return false;
              if (component == ComponentFate::kNone) component = components.of(b, c);
              return !fates.covers(v, component);
            },
            [&](std::int64_t v) { fates.widen(v, material, component); });
      });
    });
  }
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
  template std::vector<ComponentFate> component_fates(const LabelImage<DIM>&, const ComponentMap&, const Mesh<DIM>&, \
                                                      const MeshComponents<DIM>&, const PlainBlocks<DIM>&,           \
                                                      std::span<const MaterialId>, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
