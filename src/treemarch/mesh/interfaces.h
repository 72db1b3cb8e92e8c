/// \file
/// The facets between materials.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Whether the facets between a material and the outside are wanted as well.
enum class Hull : bool { leave_out, include };

/// All facets between cells of different materials and, if asked for, those with one cell only, whose `second` is
/// kOutside. At most one block of each type (line in 2D; triangle, quad in 3D), none of them empty, in the order of
/// CellType. The vertices are ordered as mesh.h says: the boundary of the cell of `first`, so that the normal points to
/// `second`. Facets are sorted by their vertices (smallest first), whatever the number of threads.
/// \pre the mesh is sound (validate.h).
template <int Dim>
std::vector<FacetBlock> extract_interfaces(const Mesh<Dim>& mesh, Hull hull, const Execution& execution);

}  // namespace treemarch
