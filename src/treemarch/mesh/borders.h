/// \file
/// The borders of a mesh: between materials, and its hull.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/mesh/facets.h"
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

/// A facet with the cells on both its sides.
struct SharedFacet {
  FacetSide own;     ///< the cell that comes first
  FacetSide beyond;  ///< the same again on the hull
  [[nodiscard]] bool is_on_hull() const { return own.block == beyond.block && own.cell == beyond.cell; }
};

/// \param sides of a facet, as visit_facets() gives them
[[nodiscard]] inline SharedFacet shared_facet(std::span<const FacetSide> sides) {
  return {sides[0], sides.size() > 1 ? sides[1] : sides[0]};
}

/// What lies at borders; good for as long as cells and their materials stay. Vertices may move.
struct Borders {
  /// One a vertex: 1 where cells of several materials meet or do not close around it, else 0.
  std::vector<std::uint8_t> vertices;
  /// All facets between such vertices, whether they separate materials or not, by their vertices in ascending order.
  RawVector<SharedFacet> facets;
};

/// Vertices are found without matching facets, and no others are matched. The same for any number of threads.
/// \pre the mesh is sound (validate.h). \throw Error(limits) above 2^32 - 1 facets
template <int Dim>
Borders find_borders(const Mesh<Dim>& mesh, const Execution& execution);

}  // namespace treemarch
