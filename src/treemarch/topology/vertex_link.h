/// \file
/// Whether each material touches a vertex in one piece.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The cells around one vertex, as a small sphere about it would cut them: each cell is a patch of the sphere, each
/// facet at the vertex a side of two patches (2D: circle, arcs and points). The boundary of a material is a manifold at
/// the vertex if and only if its patches form one disc, that is if their border is one simple closed curve. Reuse the
/// object: it keeps its memory.
template <int Dim>
class VertexLink {
 public:
  void clear();
  /// Adds a cell. \pre it has the vertex
  void add(CellType type, const VertexId* cell, VertexId vertex, MaterialId material);

  struct Excess {
    MaterialId material;
    int sheets;  ///< by how many the pieces of its boundary at the vertex, or along an edge there, exceed one
  };
  /// The materials that are no disc, ascending; empty where all is well.
  const std::vector<Excess>& excess();

 private:
  using Rim = std::array<VertexId, Dim - 1>;  // a facet without the vertex: its neighbours in it
  struct Slot {
    std::uint64_t key = kEmpty;
    MaterialId first = kOutside, second = kOutside;
  };
  struct Border {
    std::uint64_t key;
    MaterialId first, second;  // on its sides
  };
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};

  void add_side(std::uint64_t key, MaterialId material);
  void grow();
  int excess_of(MaterialId material);

  std::vector<Slot> slots_ = std::vector<Slot>(256);
  std::vector<std::uint32_t> used_;
  std::vector<Border> border_;
  std::vector<MaterialId> materials_;
  std::vector<VertexId> rim_;
  std::vector<std::uint32_t> parent_, degree_;
  std::vector<Excess> excess_;
};

}  // namespace treemarch
