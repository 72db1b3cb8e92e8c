/// \file
/// What a mesh will cost, before it is made.
#pragma once

#include <cstdint>

#include "treemarch/image/label_image.h"

namespace treemarch {

struct MeshEstimate {
  double interface_area = 0;      ///< of the faces between voxels of different materials (2D: their length), physical
  std::int64_t cells = 0;         ///< with cells of the smallest spacing at interfaces, the background included
  std::int64_t memory_bytes = 0;  ///< of the whole process at its peak
};

/// Estimates for the default method, from the area of the interfaces; expect a factor of two.
template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image);

}  // namespace treemarch
