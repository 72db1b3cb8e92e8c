/// \file
/// The cells near interfaces, with the links that let them be split in place.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The simplices of a mesh that touch a vertex of two or more materials, and what they are split into.
///
/// Only those vertices are *linked*: all their cells are here and can be listed. A vertex of one material stays one of
/// that material while its cells are split along a surface that leaves it on its own side, so no other cell is ever
/// needed. All changes are serial; reading is safe from several threads.
template <int Dim>
class ActiveCells {
 public:
  using Cell = std::array<VertexId, Dim + 1>;
  using Index = std::uint32_t;

  /// \throw Error(limits) if a cell that is no simplex touches two materials, or for more than 2^32 / (Dim + 1) cells.
  explicit ActiveCells(const Mesh<Dim>& mesh);

  [[nodiscard]] Index size() const { return static_cast<Index>(cells_.size()); }
  [[nodiscard]] const Cell& cell(Index c) const { return cells_[c]; }
  [[nodiscard]] MaterialId material(Index c) const { return materials_[c]; }
  void set_material(Index c, MaterialId material) { materials_[c] = material; }

  [[nodiscard]] bool linked(VertexId v) const { return linked_[v] != 0; }
  /// Calls f(cell, corner) for all cells of a linked vertex.
  template <class F>
  void for_each_cell(VertexId v, F&& f) const {
    for (std::uint32_t e = head_[v]; e != kNone; e = next_[e]) f(e / (Dim + 1), static_cast<int>(e % (Dim + 1)));
  }
  /// The other cell at the facet of `c` opposite to `corner`, or kNone at the hull. \pre the facet has a linked vertex
  [[nodiscard]] Index neighbour(Index c, int corner) const;

  /// Adds linked vertices with the next ids.
  void add_vertices(std::size_t count);
  /// Replaces a cell by pieces of it: the first takes its index, the others the next ones.
  /// \pre pieces.size() == materials.size() > 0
  void replace(Index c, std::span<const Cell> pieces, std::span<const MaterialId> materials);

  /// Puts the pieces into the mesh, each where the cell was that it came from.
  void write_back(Mesh<Dim>& mesh) const;

  static constexpr std::uint32_t kNone = 0xffffffffU;

 private:
  void find_linked(const Mesh<Dim>& mesh);
  void push(const Cell& cell, MaterialId material, std::int64_t parent);
  void link(Index c);
  void unlink(Index c);

  std::vector<Cell> cells_;
  std::vector<MaterialId> materials_;
  std::vector<std::int64_t> parents_;  ///< position in the mesh's block of simplices
  std::vector<std::uint8_t> linked_;   ///< per vertex
  std::vector<std::uint32_t> head_;    ///< per vertex: its first entry; an entry is cell * (Dim + 1) + corner
  std::vector<std::uint32_t> next_;    ///< per entry: the next one of the same vertex
};

}  // namespace treemarch
