/// \file
/// Error-driven sizes: small cells where large ones would be untrue to the image.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/image/uniform_blocks.h"
#include "treemarch/sizing/lattice.h"

namespace treemarch {

/// Raises levels until no cell misplaces interfaces by more than the tolerance, or the level is reached.
///
/// The error of a cell: the labels of its voxels and of those around it (a quarter of its side on each side, a voxel
/// at least) are regressed by linear functions of the place, one a label; the voxels that another label's function
/// would take, and their own label's half-space of the right volume would not, as a volume over the area of one
/// interface through all these voxels, are a mean distance between the image's interface and the best that piecewise
/// linear weights can do at this size. A cell is also split when it would lose a piece of a label of 8 voxels or more
/// that lies wholly within these voxels. \param uniform of the image. \param levels as from required_levels(); one a
/// finest cell. \param tolerance physical. \param last no cell is split to more than this level for its error.
template <int Dim>
void refine_by_error(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const SizedLattice<Dim>& sized,
                     double tolerance, int last, std::vector<std::uint8_t>& levels, const Execution& execution);

}  // namespace treemarch
