/// \file
/// Cleaning an image of specks before it is meshed.
#pragma once

#include <cstdint>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/report/report.h"

namespace treemarch {

struct CleanUpOptions {
  std::int64_t remove_islands = 0;  ///< parts of labels with fewer voxels than this are given away; 0: none
  std::int64_t fill_holes = 0;      ///< enclosed parts of the background with fewer voxels than this too; 0: none
  std::int32_t background = 0;      ///< the label that means background
};

/// Gives islands, then holes, to the labels around them.
///
/// An island is a component (voxels of a label joined over faces) of fewer than options.remove_islands voxels. The
/// largest component of a label (of equal ones the first in scan order) is none, so no label vanishes. A hole is a
/// component of the background of fewer than options.fill_holes voxels that does not touch a side of the image. Each
/// takes the label that most of the voxel faces around it have, those of other islands or holes apart; of equal labels
/// the one that comes first in the image. What touches nothing else is treated once its neighbours are; if nothing but
/// islands is left, they stay. Materials are numbered anew by first appearance.
template <int Dim>
CleanUpReport clean_up(LabelImage<Dim>& image, const CleanUpOptions& options, Execution& execution);

}  // namespace treemarch
