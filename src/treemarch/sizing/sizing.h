/// \file
/// From sizes to levels of the tree.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

/// The level at least that the leaf at each cell of the lattice must have, first axis fastest: the input of
/// build_spacetree(). A size asks for the first level whose longest side is not above it, or for the deepest level that
/// sizes may ask for. A cell takes the finest demand of the voxels that it overlaps; a voxel demands the size of its
/// material or, when a face of it lies on an interface, of its interfaces; its own size; and what rule.layers asks for
/// there. rule.tolerance then splits cells further (error_sizing.h), rule.grading makes room around small ones.
/// \pre the lattice fills the box of the image; rule.voxel_size is empty or has one entry a voxel.
template <int Dim>
std::vector<std::uint8_t> required_levels(const LabelImage<Dim>& image, const SizedLattice<Dim>& lattice,
                                          const SizingRule& rule, const Execution& execution);

}  // namespace treemarch
