/// \file
/// Points that must stay in cells of their material while vertices move.
#pragma once

#include <algorithm>
#include <cstdint>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// The centre of a voxel that stands for a component of the image: as long as it lies in cells of its material, the
/// component is not lost.
struct Anchor {
  Vec<3> point{};  ///< inner frame, z = 0 in 2D
  MaterialId material = 0;
};

/// \param voxel its linear index
template <int Dim>
Anchor anchor_at(const LabelImage<Dim>& image, std::int64_t voxel) {
  Anchor anchor{.material = image.voxels[voxel]};
  std::ranges::copy(image.centre(coord_of(voxel, image.extent)), anchor.point.begin());
  return anchor;
}

}  // namespace treemarch
