/// \file
/// Vertices at borders: those of the facets between materials and of the hull, found without matching any facets.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Sets `marks` (one a vertex) to 1 at vertices with cells of several materials. \param first_cell of block 0: cells
/// before it are not looked at, and must not be beside such vertices.
template <int Dim>
void mark_interfaces(const Mesh<Dim>& mesh, std::int64_t first_cell, std::vector<std::uint8_t>& marks,
                     const Execution& execution);

/// Sets `marks` (one a vertex) to 1 where it is 0 and the cells do not close around the vertex. \param first_cell of
/// block 0: cells before it are not looked at, and must not be beside vertices in question.
template <int Dim>
void mark_hull(const Mesh<Dim>& mesh, std::int64_t first_cell, std::vector<std::uint8_t>& marks,
               const Execution& execution);

}  // namespace treemarch
