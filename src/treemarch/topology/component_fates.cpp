#include "treemarch/topology/component_fates.h"

#include <algorithm>
#include <atomic>
#include <numeric>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;

/// Widens a fate by a component of the mesh, whatever other threads do at the same time.
void widen(ComponentFate& fate, std::uint32_t component) {
  const std::atomic_ref<std::uint32_t> first(fate.first), last(fate.last);
  std::uint32_t now = first.load(std::memory_order_relaxed);
  while (component < now && !first.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
  }
  now = last.load(std::memory_order_relaxed);
  while (component > now && !last.compare_exchange_weak(now, component, std::memory_order_relaxed)) {
  }
}

bool covers(ComponentFate& fate, std::uint32_t component) {
  return std::atomic_ref(fate.first).load(std::memory_order_relaxed) <= component &&
         std::atomic_ref(fate.last).load(std::memory_order_relaxed) >= component;
}

}  // namespace

template <int Dim>
std::vector<ComponentFate> component_fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
                                           const MeshComponents<Dim>& components, std::span<const MaterialId> to_image,
                                           const Execution& execution) {
  std::vector<ComponentFate> fates(map.components.size());
  const VoxelCentres<Dim> centres(image);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    parallel_for(execution, block.size(), kCellsPerTask, [&](std::int64_t c) {
      const MaterialId material = to_image[block.materials[static_cast<std::size_t>(c)]];
      if (material == kOutside) return;
      std::uint32_t component = ComponentFate::kNone;  // looked up when it is needed
      for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
        centres.visit(
            simplex,
            [&](std::int64_t v) {
              if (image.voxels[v] != material) return false;
              if (component == ComponentFate::kNone) component = components.of(b, c);
              return !covers(fates[map.of_voxel[static_cast<std::size_t>(v)]], component);
            },
            [&](std::int64_t v) { widen(fates[map.of_voxel[static_cast<std::size_t>(v)]], component); });
      });
    });
  }
  return fates;
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
                                                      const MeshComponents<DIM>&, std::span<const MaterialId>,       \
                                                      const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
