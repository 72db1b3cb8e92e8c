/// \file
/// The proved bound of the default cut, by enumeration of all undisplaced stencils. See docs/stages/cut.md.
#pragma once

#include <array>
#include <set>

#include "treemarch/core/vec.h"

namespace treemarch {

/// A lattice simplex up to translation: integer corners, the first at the origin.
template <int Dim>
using LatticeShape = std::array<Coord<Dim>, Dim + 1>;

/// All shapes that tessellate_body_centred() makes, read off its own output: a simplex lies in at most two leaves that
/// share a face and depends on those around one edge of it, so the refinements of 2 x 2 (x 2) roots show every shape,
/// at the sides of the box too. \param graded false: only those inside a uniform tree.
template <int Dim>
std::set<LatticeShape<Dim>> lattice_shapes(bool graded);

struct StencilBound {
  double smallest_angle = 180, largest_angle = 0;  ///< degrees, over all stencils
  double quality = 180;                            ///< mesh/simplex_quality.h
};

/// The worst undisplaced stencil: every pattern of cuts in the middle of edges, every order of the keys.
/// \param sides of a cell, up to a factor. \param long_first only orders in which longer edges (on the lattice) come
/// first.
template <int Dim>
StencilBound worst_stencil(const std::set<LatticeShape<Dim>>& shapes, bool long_first, const Vec<Dim>& sides);

/// The quality that a cut can guarantee on any 2:1 tree of cells with these sides, at most 18.4 for cubes.
template <int Dim>
double guaranteed_quality(const Vec<Dim>& sides);

}  // namespace treemarch
