/// \file
/// Sections of a mesh by a plane across its last axis: what a space-time mesh is at one moment.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The section of a mesh of simplices where the last coordinate is `position`: of pentatopes tetrahedra, of tetrahedra
/// triangles, each with the material of the cell that it comes from.
///
/// A cell is cut into a simplex or a prism over one; prisms are split by the order of their vertices, so that
/// neighbours agree (march/paper_split.h). Vertices within 1e-7 of the extent along the last axis lie in the plane:
/// they are kept, and no sliver is made of them. A facet in the plane belongs to the cell before it, the section being
/// the limit from below; at the start of the mesh it is the limit from above. Points are those of the mesh in their
/// order, then cuts in the order of their edges. The result is conforming and positive if the mesh is, and the same for
/// any number of threads. Empty where the plane misses the mesh. \throw Error(input) if a cell is no simplex.
template <int Dim>
Mesh<Dim - 1> slice_mesh(const Mesh<Dim>& mesh, double position, const Execution& execution);

}  // namespace treemarch
