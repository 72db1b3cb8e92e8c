/// \file
/// The material of each leaf of a tree.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// Gives each leaf the material that has the largest part of its volume, each part multiplied by the weight of its
/// material (a weight above 1 keeps thin structures alive). Ties go to the material with fewer voxels in the image,
/// then to the one that comes first in scan order: no choice depends on the label values, and only the last one on the
/// orientation of the image.
/// \param weights one a material, >= 0; entries that are missing are 1.
/// \pre the lattice of the tree fills the box of the image.
template <int Dim>
void assign_materials(Spacetree<Dim>& tree, const LabelImage<Dim>& image, const std::vector<double>& weights,
                      const Execution& execution);

}  // namespace treemarch
