/// \file
/// Whether each material touches a vertex in one piece.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
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
  /// \param name for pairs()
  /// \param border null, or one a vertex: facets with a neighbour of the vertex whose value is 0, that is inside one
  /// material, are passed over
  void add(CellType type, const VertexId* cell, VertexId vertex, MaterialId material, std::uint32_t name = 0,
           const std::uint8_t* border = nullptr);

  /// Cells of one material that share a facet of which the vertex is the smallest (of three, where it has four).
  [[nodiscard]] const std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs() const { return pairs_; }

  struct Excess {
    MaterialId material;
    int sheets;  ///< by how many the pieces of its boundary at the vertex, or along an edge there, exceed one
  };
  /// The materials that are no disc, ascending; empty where all is well.
  const std::vector<Excess>& excess();

 private:
  /// A facet at the vertex, named by the neighbours of the vertex in it.
  struct Slot {
    std::uint64_t key = kEmpty;
    MaterialId first = kOutside, second = kOutside;
    std::uint32_t name = 0;  // of the first cell
  };
  struct Border {
    std::uint64_t key;
    MaterialId first, second;  // on its sides
  };
  static constexpr std::uint64_t kEmpty = ~std::uint64_t{0};

  void add_side(std::uint64_t key, MaterialId material, std::uint32_t name);
  void grow();
  int excess_of(MaterialId material);

  std::vector<Slot> slots_ = std::vector<Slot>(256);
  std::vector<std::uint32_t> used_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
  VertexId vertex_ = 0;
  std::vector<Border> border_;
  std::vector<MaterialId> materials_;
  std::vector<VertexId> rim_;
  std::vector<std::uint32_t> parent_, degree_;
  std::vector<Excess> excess_;
};

}  // namespace treemarch
