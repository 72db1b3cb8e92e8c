/// \file
/// Points that must stay in cells of their material while vertices move.
#pragma once

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// The centre of a voxel that stands for a component of the image: as long as it lies in cells of its material, the
/// component is not lost.
struct Anchor {
  Vec<3> point{};  ///< inner frame, z = 0 in 2D
  MaterialId material = 0;
};

}  // namespace treemarch
