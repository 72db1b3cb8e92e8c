/// \file
/// Which components of a mesh hold voxels of a component of its image.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "treemarch/repair/bridge.h"
#include "treemarch/topology/component_fates.h"

namespace treemarch {

/// Which components of the mesh hold voxels of a component of the image.
class PartsOfComponents {
 public:
  template <int Dim>
  PartsOfComponents(const ComponentFates& fates, const BrokenComponents<Dim>& broken) : fates_(fates) {
    for (const auto& p : broken.parts) split_.push_back({p.image_component, p.mesh_component});
    std::ranges::sort(split_);
  }
  /// Whether a component of the image is in the mesh, but not in a part.
  [[nodiscard]] bool is_elsewhere(std::uint32_t component, std::uint32_t part) const {
    const ComponentFate& fate = fates_.of[component];
    if (fate.lost()) return false;
    if (part < fate.first || part > fate.last) return true;
    // Of a component in parts that is not to be mended any part between the first and the last counts.
    return fate.split() && !std::ranges::binary_search(split_, std::pair(component, part)) &&
           std::ranges::binary_search(split_, component, {}, &std::pair<std::uint32_t, std::uint32_t>::first);
  }

 private:
  const ComponentFates& fates_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> split_;  // component of the image and of the mesh, ascending
};

}  // namespace treemarch
