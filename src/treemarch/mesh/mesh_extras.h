/// \file
/// What a mesh file may hold besides cells and their labels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Vertices under a name, for fixed degrees of freedom and the like.
struct NodeSet {
  std::string name;
  std::vector<VertexId> vertices;  ///< ascending
};

struct MeshExtras {
  std::vector<std::int32_t> cell_part;    ///< one a cell, through the blocks; empty: no partition
  std::vector<std::int32_t> vertex_part;  ///< one a vertex
  std::vector<NodeSet> node_sets;

  [[nodiscard]] bool empty() const { return cell_part.empty() && node_sets.empty(); }
};

}  // namespace treemarch
