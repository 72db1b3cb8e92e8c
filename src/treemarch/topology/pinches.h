/// \file
/// Where the boundary of a material is no manifold in the image itself.
#pragma once

#include <compare>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {

/// A corner of voxels where the voxels of a material touch themselves along an edge or in a point only, or its
/// complement does.
struct ImagePinch {
  std::int64_t corner = 0;  ///< position among the corners of voxels, (extent + 1) an axis, first axis fastest
  MaterialId material = 0;
  auto operator<=>(const ImagePinch&) const = default;
};

/// All pinches of an image, by corner, then by material. \param uniform of the image
template <int Dim>
std::vector<ImagePinch> find_image_pinches(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform,
                                           const Execution& execution);

}  // namespace treemarch
