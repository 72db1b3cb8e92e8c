/// \file
/// Which vertices lie on junction curves, on interfaces and in the volume, and along which edges they may be smoothed.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The cells of each vertex of a mesh of simplices, ascending.
class VertexCells {
 public:
  /// \throw Error(limits) for more than 2^32 - 1 cells
  template <int Dim>
  VertexCells(const CellBlock& simplices, const Points<Dim>& points);

  [[nodiscard]] std::span<const std::uint32_t> operator[](VertexId v) const {
    return {cells_.data() + first_[v], first_[v + 1] - first_[v]};
  }

 private:
  std::vector<std::uint64_t> first_;
  std::vector<std::uint32_t> cells_;
};

/// The subsets of the paper, in the order in which they are smoothed. In 2D there are no curves: where three materials
/// meet is a point.
enum class Subset : std::uint8_t { curve, interface, volume, fixed };

/// The vertices of one subset that may move, and their neighbours in it.
struct SubsetGraph {
  std::vector<VertexId> vertices;       ///< ascending
  std::vector<std::uint64_t> first;     ///< where the neighbours of each begin; one more than vertices
  std::vector<VertexId> neighbours;     ///< ascending for each vertex
  std::vector<std::uint32_t> by_block;  ///< positions in `vertices`, grouped by block of space, scattered in each
  std::vector<std::uint32_t> blocks;   ///< where each block begins in by_block, grouped by colour; one more than blocks
  std::vector<std::uint32_t> colours;  ///< where each colour begins in `blocks`; one more than there are

  [[nodiscard]] std::span<const VertexId> neighbours_of(std::size_t i) const {
    return {neighbours.data() + first[i], first[i + 1] - first[i]};
  }
};

/// Classifies the vertices of a mesh whose simplices fill a box.
///
/// A vertex of one material is in the volume, of two on an interface, of three or more on a curve. The faces of the box
/// are strata too: a vertex on them keeps the coordinates that it shares with them. What is left to it may have two or
/// more dimensions, or one, if it has just two neighbours there; else it is fixed: corners, points, ends of curves,
/// curves that meet. Vertices of cells other than simplices are fixed.
template <int Dim>
class Strata {
 public:
  /// \pre `mesh` outlives this object, and its cells do not change
  Strata(const Mesh<Dim>& mesh, const Execution& execution);

  [[nodiscard]] Subset subset(VertexId v) const { return subset_[v]; }
  /// Bit d is set if coordinate d may not change.
  [[nodiscard]] unsigned pinned(VertexId v) const { return (faces_[v] | faces_[v] >> Dim) & ((1U << Dim) - 1); }
  [[nodiscard]] const VertexCells& cells() const { return cells_; }
  [[nodiscard]] const CellBlock& simplices() const { return simplices_; }

  /// Neighbours along edges of the subset and on the same faces of the box; those in subsets of fewer dimensions are
  /// among them. Vertices in different blocks of one colour share no cell.
  [[nodiscard]] SubsetGraph graph(Subset subset, const Execution& execution) const;

 private:
  void find_faces(const Execution& execution);
  void classify(const Execution& execution);
  /// Appends the neighbours of a vertex; returns false, without any, if it has to stay.
  bool append_neighbours(VertexId v, std::vector<VertexId>& out) const;
  void find_blocks(SubsetGraph& graph, const Execution& execution) const;
  [[nodiscard]] Vec<Dim> widest_pair(const SubsetGraph& graph, const Execution& execution) const;

  const Mesh<Dim>& mesh_;
  const CellBlock& simplices_;
  VertexCells cells_;
  std::vector<std::uint8_t> faces_;  ///< bit d: on the lower face of axis d; bit Dim + d: on the upper one
  std::vector<Subset> subset_;
};

}  // namespace treemarch
