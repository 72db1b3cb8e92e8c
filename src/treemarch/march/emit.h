/// \file
/// Step C of the default cut: the pieces of all simplices as a mesh.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/march/band.h"
#include "treemarch/march/retreat.h"
#include "treemarch/march/snap.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

struct EmitReport {
  std::int64_t cut_edges = 0, triple_points = 0, inner_points = 0;
};

/// Points and cells of the mesh: first the simplices far from interfaces, then the pieces of the band, both in the
/// order of the leaves. A piece takes the label that all its lattice vertices share; else the heaviest label at its
/// centroid. \pre geometry.retreat() was called. \throw Error(limits) if there are 2^32 points or more.
template <int Dim>
EmitReport emit_pieces(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
                       const CutGeometry<Dim>& geometry, const Field<Dim>& field, Mesh<Dim>& mesh,
                       Execution& execution);

}  // namespace treemarch
