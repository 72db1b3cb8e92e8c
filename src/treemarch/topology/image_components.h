/// \file
/// Connected components of the materials of an image.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// A set of voxels of one material that are connected over faces.
struct ImageComponent {
  MaterialId material = 0;
  std::int64_t voxels = 0;
  std::int64_t first_voxel = 0;  ///< its first in scan order
};

/// All components, by their first voxels. Works on runs along the first axis, in almost linear time.
/// \throw Error(limits) if there are 2^32 runs or more.
template <int Dim>
std::vector<ImageComponent> image_components(const LabelImage<Dim>& image, const Execution& execution);

/// The same, and the component of each voxel as an index into them.
struct ComponentMap {
  std::vector<ImageComponent> components;
  std::vector<std::uint32_t> of_voxel;
};

template <int Dim>
ComponentMap map_components(const LabelImage<Dim>& image, const Execution& execution);

}  // namespace treemarch
