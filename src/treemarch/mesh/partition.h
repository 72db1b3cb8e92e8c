/// \file
/// Parts of a mesh for parallel solvers.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct Partition {
  std::vector<std::int32_t> cell_part;    ///< from 0; one a cell, through the blocks
  std::vector<std::int32_t> vertex_part;  ///< the smallest part among the cells of each vertex, which owns it
  std::vector<std::int64_t> cells;        ///< of each part
  std::int64_t facets_between = 0;        ///< facets between two parts
  std::int64_t vertices_between = 0;      ///< vertices of more than one part
};

/// Divides the cells into parts of as good as equal size with few facets between them: METIS, recursive k-way
/// partitioning of the graph of cells and facets (Karypis and Kumar 1998). The same for any number of threads.
/// \pre the mesh is sound. \throw Error(usage) for less than 2 parts or more parts than cells; Error(limits) for more
/// cells or facets than METIS counts.
template <int Dim>
Partition partition_mesh(const Mesh<Dim>& mesh, int parts, Execution& execution);

}  // namespace treemarch
