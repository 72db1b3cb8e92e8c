/// \file
/// Sizes for those who give none, or only say how true the mesh shall be.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

/// How much of the image a mesh keeps, as one choice: bounds on the number of simplices (3D: half a million, two, eight
/// million; a tenth of it in 2D) and a tolerance of one voxel, half and a quarter.
enum class Detail { coarse, normal, fine };

/// Sizes that follow the image: cells at interfaces are as large as the tolerance allows, but not larger than nine
/// tenths of the mean thickness of either material, which is twice its volume over the area of its voxel faces.
/// \param tolerance, floor as SizingRule::tolerance and floor_size, physical, > 0. \param largest as
/// SizingRule::max_size; 0 for 16 times the floor.
template <int Dim>
SizingRule driven_sizes(const LabelImage<Dim>& image, double tolerance, double floor, double largest,
                        const Execution& execution);

struct SizeLimits {
  double least = 0;    ///< halves of the floor end here, and the floor is a power of two times this; 0: see below
  double largest = 0;  ///< no size is above it; 0: 16 times the floor
};

/// The same with a tolerance and a floor by detail: the floor is the smallest spacing, or what keeps a mesh with such
/// cells at all interfaces to the number of simplices. Materials too thin for it get halves of the floor, down to the
/// smallest spacing.
template <int Dim>
SizingRule default_sizes(const LabelImage<Dim>& image, Detail detail, const SizeLimits& limits,
                         const Execution& execution);

}  // namespace treemarch
