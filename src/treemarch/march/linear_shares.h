/// \file
/// The simplest separating function, of voxels in any dimension: what space-time is separated by.
#pragma once

#include "treemarch/image/label_image.h"
#include "treemarch/march/separate.h"

namespace treemarch {

/// d-linear interpolation of the voxels' indicators between voxel centres, constant beyond the outermost centres.
/// \pre `image` outlives the result
template <int Dim>
MaterialField<Dim> linear_shares(const LabelImage<Dim>& image);

}  // namespace treemarch
