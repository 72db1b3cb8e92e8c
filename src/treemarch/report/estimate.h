/// \file
/// What a mesh will cost, before it is made.
#pragma once

#include <cstdint>

#include "treemarch/image/label_image.h"

namespace treemarch {

struct MeshEstimate {
  std::int64_t interface_voxels = 0;  ///< with a neighbour of another material across a face
  std::int64_t cells = 0;         ///< with one-voxel cells at interfaces, the background included; within a factor 2
  std::int64_t memory_bytes = 0;  ///< of the whole process at its peak
};

/// Estimates from the number of voxels at interfaces.
template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image);

}  // namespace treemarch
