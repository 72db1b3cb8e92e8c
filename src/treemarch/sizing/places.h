/// \file
/// Sizes by place: boxes, balls and images of sizes, all in world coordinates.
#pragma once

#include <array>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// A part of the world in which cells shall have a size, in the coordinates of the image file.
template <int Dim>
struct SizedPlace {
  bool is_ball = false;
  Vec<Dim> low{};   ///< lower corner; of a ball its centre
  Vec<Dim> high{};  ///< upper corner; unused for a ball
  double radius = 0;
  double size = 0;  ///< > 0
};

/// Lowers `sizes` (SizingRule::voxel_size, filled with 0 if it is empty) to the size of a place in the voxels whose
/// centres lie in it. \return number of those voxels.
template <int Dim>
std::int64_t add_place(const LabelImage<Dim>& image, const SizedPlace<Dim>& place, std::vector<float>& sizes);

/// The same with the value of the nearest voxel of a size image at the centre of each voxel; values that are not above
/// 0, or not finite, ask for nothing, and nothing is asked for beyond the size image. \return number of voxels with a
/// size. \pre the affine of `values` can be inverted.
template <int Dim>
std::int64_t add_size_image(const LabelImage<Dim>& image, const GreyImage<Dim>& values, std::vector<float>& sizes);

}  // namespace treemarch
