/// \file
/// Operations that change the connectivity of a few cells. Each one is done only if the worst of the cells that it
/// touches gets better, and keeps the materials, the hull and the topology of interfaces.
#pragma once

#include "treemarch/core/vec.h"
#include "treemarch/improve/patch.h"

namespace treemarch {

/// Replaces the two cells beside the facet opposite to a corner of c by Dim cells around the line that joins their
/// opposite vertices (2-2 in the plane, 2-3 in space), if they have one material.
template <int Dim>
bool flip_facet(Patch<Dim>& patch, CellId c, int corner);

/// Takes the edge a-b away: the vertices around it are joined by the best triangles instead (dynamic programming, after
/// Klincsek; rings of at most 10). An edge on an interface goes if its two facets there are nearly flat (cosine of the
/// normals at least 0.85) and so are the new ones, one on a side of the box if the new ones lie on that side too.
/// \param box upper corner of the image's box. \pre a has a star
bool remove_edge(Patch<3>& patch, VertexId a, VertexId b, const Vec<3>& box);

/// Moves u into v, dropping the cells that they share. u is inside one material (or on a side of the box, v too).
/// \pre u has a star
template <int Dim>
bool collapse_edge(Patch<Dim>& patch, VertexId u, VertexId v, const Vec<Dim>& box);

/// Smallest quality of some cells in degrees, -1 if one is inverted.
template <int Dim>
double quality_of(const Patch<Dim>& patch, std::span<const NewCell<Dim>> cells);
template <int Dim>
double quality_of(const Patch<Dim>& patch, std::span<const CellId> cells);

}  // namespace treemarch
