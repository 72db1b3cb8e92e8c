/// \file
/// The coordinates in which meshes are written.
#pragma once

#include "treemarch/image/frame.h"

namespace treemarch {

/// file: the world of the image as its file declares it; ras, lps: the same turned to those anatomical axes; index:
/// voxel centres at integers.
enum class OutputSpace { file, ras, lps, index };

/// The frame that maps inner points to coordinates of `space` by to_world(). Columns of its direction are no unit
/// vectors for OutputSpace::index.
/// \throw Error(usage) for ras and lps where the image's frame names no such axes.
template <int Dim>
Frame<Dim> output_frame(const Frame<Dim>& frame, OutputSpace space);

/// Whether the map to the world is a reflection, so that positive cells become negative.
template <int Dim>
bool is_left_handed(const Frame<Dim>& frame);

}  // namespace treemarch
