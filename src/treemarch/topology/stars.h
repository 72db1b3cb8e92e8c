/// \file
/// The cells around vertices.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// A cell as it is named in stars.
struct StarCell {
  std::uint32_t cell;   ///< within its block
  std::uint32_t block;  ///< index into Mesh::blocks
};

/// Number of parts into which visit_stars() divides the vertices of a mesh of so many points.
[[nodiscard]] std::int64_t star_part_count(std::int64_t points);

/// Visits the vertices of a mesh that have a value other than 0 in `among` (one a point), with the cells around each of
/// them in any order. visit(part, vertex, cells) runs in parallel for different parts, in sequence within a part; parts
/// follow the vertices, so output collected per part and joined in the order of the parts is sorted. In passes of
/// bounded memory.
template <int Dim>
void visit_stars(const Mesh<Dim>& mesh, std::span<const std::uint8_t> among, const Execution& execution,
                 const std::function<void(std::int64_t part, VertexId vertex, std::span<const StarCell> cells)>& visit);

}  // namespace treemarch
