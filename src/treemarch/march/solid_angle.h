/// \file
/// Solid angles of cells at their corners: the paper's separating function for any unstructured mesh (paper eq. 1).
#pragma once

#include <span>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Share of the full sphere (2D: circle) around a corner that the cone of two edges (2D) or three edges (3D) fills, in
/// (0, 1/2) for a convex one. The edges need no unit length; negatively oriented ones give a negative share.
double cone_ratio(const Vec<2>& a, const Vec<2>& b);
double cone_ratio(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

/// The solid angle ratio a_c(v) of a cell at its corner: the cone spanned by the edges that leave the corner, split
/// into cones of Dim edges where there are more (the apex of a pyramid). \param cell the vertices of the cell,
/// vertex_count(type) of them \param corner position of the vertex within `cell` \pre dimension(type) == Dim; Dim is 2
/// or 3
template <int Dim>
double solid_angle_ratio(CellType type, const VertexId* cell, int corner, std::span<const Vec<Dim>> points);

}  // namespace treemarch
