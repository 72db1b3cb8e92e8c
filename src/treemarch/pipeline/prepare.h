/// \file
/// What of an image is meshed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// A selection of materials and of a part of the image. Labels are written as LabelTable reads them.
struct PrepareOptions {
  std::vector<std::string> keep;   ///< SET: all others become background; empty keeps all
  std::vector<std::string> drop;   ///< SET: these become background
  std::vector<std::string> merge;  ///< SET=LABEL: become one; a new name takes the smallest number of the set
  std::string roi;                 ///< X0:X1,Y0:Y1,Z0:Z1 in voxels counted from 0, upper ends excluded; empty: all
  std::int32_t background = 0;     ///< the label that means background
};

/// Applies merge, keep, drop, then roi. Materials are numbered anew by first appearance.
/// \throw Error(usage) for unknown labels and for a region that is not inside the image; Error(input) if nothing but
/// background is left.
template <int Dim>
LabelImage<Dim> prepare_image(LabelImage<Dim> image, const PrepareOptions& options, Execution& execution);

/// The part of a grey image that a roi names, as in PrepareOptions. \throw Error(usage)
template <int Dim>
GreyImage<Dim> crop_image(GreyImage<Dim> image, const std::string& roi);

}  // namespace treemarch
