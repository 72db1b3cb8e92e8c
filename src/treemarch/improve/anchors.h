/// \file
/// Points that must stay in cells of their material, or out of them, while vertices move.
#pragma once

#include <algorithm>
#include <cstdint>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// The centre of a voxel. One that stands for a component of the image stays inside: as long as it lies in cells of its
/// material, the component is not lost.
struct Anchor {
  Vec<3> point{};  ///< inner frame, z = 0 in 2D
  MaterialId material = 0;
  bool inside = true;  ///< false: a move must not bring cells of the material to it
};

/// One with a cell of its material that holds it, of the only block of a mesh.
struct HeldAnchor {
  std::uint32_t cell;
  Anchor anchor;
};

/// \param voxel its linear index
template <int Dim>
Anchor anchor_at(const LabelImage<Dim>& image, std::int64_t voxel) {
  Anchor anchor{.material = image.voxels[voxel]};
  std::ranges::copy(image.centre(coord_of(voxel, image.extent)), anchor.point.begin());
  return anchor;
}

}  // namespace treemarch
