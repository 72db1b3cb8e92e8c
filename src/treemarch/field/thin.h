/// \file
/// Keeps sheets, wires and grains that are too thin for a smoothed field. See docs/stages/field.md, "Thin structures".
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/voxel_lists.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Gives voxels of structures that the field would lose, and their neighbours, their raw indicator back.
///
/// A flagged voxel (its own label does not win by a margin) is a seed if none of its neighbours of its label is free of
/// a flag; seeds grow two steps through flagged voxels of their label. Bridges, flagged voxels whose neighbours of
/// their label hang together only through them, are added (this goes beyond the design). All of these and one ring
/// around them become raw. Neighbours share a face, an edge or a corner. So every component of a label keeps a voxel
/// where the label wins: either one without a flag, or, if there is none, all of it is raw. \param flagged one bit a
/// voxel, one word a brick, in the order of VoxelLists::place_in_brick(). \return number of voxels that became raw.
template <int Dim>
std::int64_t keep_thin(const LabelImage<Dim>& image, const std::vector<std::uint64_t>& flagged, VoxelLists<Dim>& lists,
                       const Execution& execution);

}  // namespace treemarch
