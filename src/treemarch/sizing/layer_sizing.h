/// \file
/// Thickness-driven sizes: several cells across thin layers.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Sizes that put `layers` cells across every part of a material that is thinner than layers * largest, one a voxel: 0
/// where nothing is asked for, never below `smallest`.
///
/// Thickness is measured on the middle surface of a material: voxels that have no neighbour (26 in 3D) of their label
/// that is deeper inside by more than half of its distance. There it is the shortest chord through the voxel along the
/// axes and diagonals; the size it asks for holds for all voxels of the label within half of it. A side of the image
/// ends a chord along an axis; diagonals that reach it do not count.
/// \pre layers > 0, 0 < smallest, largest > 0
template <int Dim>
std::vector<float> layer_sizes(const LabelImage<Dim>& image, int layers, double smallest, double largest,
                               const Execution& execution);

}  // namespace treemarch
