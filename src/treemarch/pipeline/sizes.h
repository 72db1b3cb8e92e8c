/// \file
/// From the sizes that a user gives to a complete rule.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

/// \throw Error(usage) for a size, tolerance or other number that is out of range.
template <int Dim>
void check_sizes(const LabelImage<Dim>& image, const SizingRule& sizes);

/// The sizes of the options: with a tolerance, min_size becomes the floor (1 voxel where it is not given); with
/// neither, the guaranteed method takes those of options.detail.
template <int Dim>
SizingRule complete_sizes(const LabelImage<Dim>& image, const MeshOptions& options, const Execution& execution);

}  // namespace treemarch
