/// \file
/// Sizes for those who give none.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

/// Sizes that follow the structures of the image: at the interfaces of a material cells of half its mean thickness, but
/// not below the smallest spacing, and not above a common size that keeps the whole mesh to about two million simplices
/// (3D; 2D: two hundred thousand). The mean thickness is twice the volume over the area of the voxel faces. \param
/// largest as in SizingRule::max_size: no size is above it; 0 for no limit.
template <int Dim>
SizingRule default_sizes(const LabelImage<Dim>& image, double largest, const Execution& execution);

}  // namespace treemarch
