/// \file
/// Connected components of the materials of a mesh.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Disjoint sets that several threads may join at once. The roots are the smallest members whatever the order.
class SharedDisjointSets {
 public:
  using Index = std::uint32_t;
  explicit SharedDisjointSets(std::size_t n = 0);

  Index find(Index i) const {
    while (true) {
      Index up = at(i).load(std::memory_order_relaxed);
      if (up == i) return i;
      const Index above = at(up).load(std::memory_order_relaxed);
      if (above != up) at(i).compare_exchange_weak(up, above, std::memory_order_relaxed);
      i = above;
    }
  }
  void join(Index a, Index b) {
    while (true) {
      a = find(a);
      b = find(b);
      if (a == b) return;
      Index root = std::max(a, b);
      if (at(root).compare_exchange_strong(root, std::min(a, b), std::memory_order_relaxed)) return;
    }
  }
  [[nodiscard]] std::size_t size() const { return parent_.size(); }
  [[nodiscard]] bool is_root(Index i) const { return parent_[i] == i; }

 private:
  [[nodiscard]] std::atomic_ref<Index> at(Index i) const { return std::atomic_ref(parent_[i]); }
  mutable std::vector<Index> parent_;  // finding shortens the paths
};

/// A vertex of a mesh where a material touches itself: along an edge that four of its boundary's facets share, or in a
/// point only. The hull belongs to the boundary.
struct MeshPinch {
  VertexId vertex = 0;
  MaterialId material = 0;
  int sheets = 0;  ///< of its boundary beyond one, at least 1 (VertexLink::Excess)
};

/// Components of the cells of each material, connected over facets, and where its boundary is no manifold. Refers to
/// the mesh, which must not change. \pre the mesh is sound (mesh/validate.h)
template <int Dim>
class MeshComponents {
 public:
  using Index = SharedDisjointSets::Index;
  /// Needs about 5 bytes a vertex and 4 a cell. The same for any number of threads.
  MeshComponents(const Mesh<Dim>& mesh, const Execution& execution);

  /// The component of a cell: two cells are in one if and only if the numbers are equal. May be called from several
  /// threads.
  [[nodiscard]] Index of(std::size_t block, std::int64_t cell) const { return sets_.find(part_of(block, cell)); }
  /// Numbers of components are below this.
  [[nodiscard]] std::size_t index_end() const { return sets_.size(); }
  /// Components of each material.
  [[nodiscard]] std::vector<std::int64_t> count() const;
  /// All pinches, by vertex, then by material; none are looked for in four dimensions.
  [[nodiscard]] const std::vector<MeshPinch>& pinches() const { return pinches_; }
  /// One a vertex: 0 where all cells around it are of one material and close around it, else 1.
  [[nodiscard]] const std::vector<std::uint8_t>& border() const { return border_; }

 private:
  /// What is joined: inner vertices, which stand for the cells around them, and cells without an inner vertex.
  [[nodiscard]] Index part_of(std::size_t block, std::int64_t cell) const {
    const VertexId* v = mesh_.blocks[block].cell(cell);
    for (int i = 0; i < vertex_count(mesh_.blocks[block].type); ++i)
      if (border_[v[i]] == 0) return v[i];
    return static_cast<Index>(first_cell_[block] + static_cast<std::size_t>(cell));
  }
  [[nodiscard]] bool is_cell(Index part) const { return part >= mesh_.points.size(); }
  void join_inside(const Execution& execution);
  void join_at_borders(const Execution& execution);

  const Mesh<Dim>& mesh_;
  std::vector<std::uint8_t> border_;
  std::vector<std::size_t> first_cell_;  // per block, numbered after the vertices
  SharedDisjointSets sets_;
  std::vector<MaterialId> material_of_vertex_;
  std::vector<MeshPinch> pinches_;
};

}  // namespace treemarch
