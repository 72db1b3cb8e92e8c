/// \file
/// Finds the vertices that the cut had to leave beside their interface.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Vertices between two or more materials where the two largest weights of the field differ by more than `tolerance`,
/// ascending. A weight changes by 0.5 to 1 over a voxel across an interface.
/// \pre the mesh has one block, of simplices.
template <int Dim>
std::vector<VertexId> off_surface_vertices(const Mesh<Dim>& mesh, const Field<Dim>& field, float tolerance,
                                           const Execution& execution);

}  // namespace treemarch
