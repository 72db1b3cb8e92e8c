/// \file
/// Which cells share which facets.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// One cell beside a facet.
struct FacetSide {
  std::uint64_t cell : 48;  ///< within its block
  std::uint64_t block : 8;  ///< index into Mesh::blocks
  std::uint64_t facet : 8;  ///< index into topology(type).facets
};

/// Number of parts into which visit_facets() divides the facets of a mesh of so many points.
[[nodiscard]] std::int64_t facet_part_count(std::int64_t points);

/// Which facets are wanted.
struct FacetFilter {
  /// If not empty, one a point: those whose vertices all have another value than 0.
  std::span<const std::uint8_t> among;
  /// Of block 0: cells before it count for nothing.
  std::int64_t first_cell = 0;
};

/// Visits every facet of a mesh once, with the cells that have it (1 on the hull, 2 inside, more where the mesh is
/// broken), ordered by block and cell.
///
/// visit(part, sides) runs in parallel for different parts, in sequence within a part; parts follow the smallest vertex
/// of a facet, and within a part facets come by their sorted vertices. Output collected per part and joined in the
/// order of the parts is therefore sorted, and the same for any number of threads. A quad and a triangle that share
/// three vertices are different facets.
///
/// A counting sort by the smallest vertex, in passes of bounded memory (about 12 bytes a facet, 200 MB at most).
/// \pre vertex indices are in range. \throw Error(limits) above 2^32 - 1 facets.
template <int Dim>
void visit_facets(const Mesh<Dim>& mesh, const Execution& execution,
                  const std::function<void(std::int64_t part, std::span<const FacetSide> sides)>& visit,
                  const FacetFilter& filter = {});

}  // namespace treemarch
