/// \file
/// Whether each material touches a vertex in one piece.
#pragma once

#include <algorithm>
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
  /// Adds a facet between two materials, or of the hull (kOutside beyond it), by the neighbours of the vertex along its
  /// rim (2D: the same one twice), instead of the cells on its sides: where all such facets at the vertex are added, no
  /// cell is needed.
  void add_facet(VertexId a, VertexId b, MaterialId first, MaterialId second) {
    facets_.push_back({name_of(a, b), first, second});
  }

  struct Excess {
    MaterialId material;
    int sheets;  ///< by how many the pieces of its boundary at the vertex, or along an edge there, exceed one
  };
  /// The materials that are no disc, ascending; empty where all is well.
  const std::vector<Excess>& excess();

 private:
  /// A facet at the vertex, named by the neighbours of the vertex in it, and the materials on its sides.
  struct Slot {
    std::uint64_t key = kEmpty;
    MaterialId first = kOutside, second = kOutside;
  };
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};
  static std::uint64_t name_of(VertexId a, VertexId b) {
    return (std::uint64_t{std::min(a, b)} << 32U) | std::max(a, b);
  }

  void add_side(std::uint64_t key, MaterialId material);
  void grow();
  [[nodiscard]] bool is_simple() const;
  int excess_of(MaterialId material);

  std::vector<Slot> slots_ = std::vector<Slot>(256);
  std::vector<std::uint32_t> used_;
  std::vector<Slot> facets_;  // added as such
  std::vector<Slot> border_;  // between materials
  std::vector<MaterialId> materials_;
  std::vector<VertexId> rim_;
  std::vector<std::uint32_t> parent_, degree_;
  std::vector<Excess> excess_;
};

}  // namespace treemarch
