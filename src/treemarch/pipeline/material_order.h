/// \file
/// The order in which the paper's method separates materials.
#pragma once

#include <vector>

#include "treemarch/image/label_image.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {

/// All materials of the image: `first`, then the others as `order` says; of equally large ones the one that appears
/// first is the larger. \pre `first` names no material twice
template <int Dim>
std::vector<MaterialId> material_order(const LabelImage<Dim>& image, MaterialOrder order,
                                       const std::vector<MaterialId>& first);

}  // namespace treemarch
