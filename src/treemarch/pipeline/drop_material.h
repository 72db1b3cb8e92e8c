/// \file
/// Leaving a material out of a mesh.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Removes the cells of a material; the others keep their order. Points, material ids and the table of labels stay as
/// they are.
template <int Dim>
void drop_cells(Mesh<Dim>& mesh, MaterialId material, const Execution& execution);

/// Takes the points without a cell out of a mesh; the others keep their order.
template <int Dim>
void drop_unused_points(Mesh<Dim>& mesh, const Execution& execution);

/// Both, at the price of moving each cell once.
template <int Dim>
void drop_material(Mesh<Dim>& mesh, MaterialId material, Execution& execution);

}  // namespace treemarch
