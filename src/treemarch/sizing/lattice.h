/// \file
/// The choice of the finest lattice and of the refinement pattern.
#pragma once

#include <string_view>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/sizing_rule.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// Reads "auto" (an empty result), one entry for all levels ("2", "3", "2x2x1"), or a list of entries, one a level from
/// coarse to fine ("3,2,2x2x1"). A single number is for all axes.
/// \throw Error(usage) if the text is anything else, or an entry divides nothing or by more than 64.
template <int Dim>
std::vector<Coord<Dim>> parse_pattern(std::string_view text);

/// Cells along an axis, at most: their centres, corners and midpoints have up to four times as large coordinates.
inline constexpr std::int32_t kMostCellsAlongAxis = 1 << 29;

template <int Dim>
struct SizedLattice {
  Lattice<Dim> lattice;
  RefinementPattern<Dim> pattern;
  /// The level of the smallest cells that a size may ask for; finer ones only fill the box to its sides.
  int deepest_level = 0;
};

/// Lays out cells of whole voxels for the sizes of a rule: the smallest cell is the smallest size rounded down to whole
/// voxels (with a warning), the roots the largest multiple by the pattern that is not above the largest size or the
/// image. Levels below the smallest cell follow where it does not divide the image, so that the box is filled exactly.
///
/// \param factors as from parse_pattern(). Empty: 2 along every axis, but along the shorter sides alone while that
/// makes cells clearly more isotropic. If moreover one voxel is at least twice as long as wide, the smallest cell is
/// the smallest near-isotropic one: several voxels along the short axes, their number per image rounded so that they
/// fill it (then they need not be whole voxels). \throw Error(usage) if a size is negative or not finite or the
/// smallest exceeds the largest, or if roots by a list of factors would be larger than 2^30 voxels.
template <int Dim>
SizedLattice<Dim> choose_lattice(const LabelImage<Dim>& image, const std::vector<Coord<Dim>>& factors,
                                 const SizingRule& rule, const Execution& execution);

}  // namespace treemarch
