/// \file
/// The part of a mesh of simplices that is being changed: stars of chosen vertices, kept up to date while cells change.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {

using CellId = std::uint32_t;

template <int Dim>
using SimplexVertices = std::array<VertexId, Dim + 1>;

template <int Dim>
struct NewCell {
  SimplexVertices<Dim> vertices;
  MaterialId material;
};

/// What a mesh still holds but has no use for.
struct Removed {
  std::vector<CellId> cells;
  std::vector<VertexId> vertices;
};

/// Takes dead cells and unused vertices out of a mesh; the last ones take their places.
template <int Dim>
void compact(Mesh<Dim>& mesh, Removed removed, const Execution& execution);

/// Works on the simplices of the mesh itself, its first block; dead cells stay there until compact(). Vertices that are
/// not chosen have no star here; nothing else limits them.
template <int Dim>
class Patch {
 public:
  /// \param chosen vertices that need stars, ascending.
  Patch(Mesh<Dim>& mesh, std::vector<VertexId> chosen, const Execution& execution);

  [[nodiscard]] const std::vector<VertexId>& chosen() const { return chosen_; }
  /// Position of a vertex in chosen(), -1 if it has no star.
  [[nodiscard]] std::int64_t slot(VertexId v) const { return v < slot_.size() ? std::int64_t{slot_[v]} - 1 : -1; }
  [[nodiscard]] bool has_star(VertexId v) const { return slot(v) >= 0; }
  /// Cells around a vertex. Ascending until cells are changed. \pre has_star(v)
  [[nodiscard]] std::span<const CellId> star(VertexId v) const {
    const Star& s = stars_[slot_[v] - 1];
    return {pool_.data() + s.first, s.size};
  }
  [[nodiscard]] SimplexVertices<Dim> cell(CellId c) const {
    SimplexVertices<Dim> v;
    for (int k = 0; k <= Dim; ++k) v[k] = block_.vertices[std::size_t{c} * (Dim + 1) + k];
    return v;
  }
  [[nodiscard]] MaterialId material(CellId c) const { return block_.materials[c]; }
  /// Whether other cells than simplices have the vertex: then it must not move. All cells around other vertices, and
  /// around edges to them, are here.
  [[nodiscard]] bool fixed(VertexId v) const { return v < fixed_.size() && fixed_[v] != 0; }
  [[nodiscard]] bool alive(CellId c) const { return block_.vertices[std::size_t{c} * (Dim + 1)] != kNoVertex; }
  [[nodiscard]] const Vec<Dim>& point(VertexId v) const { return mesh_.points[v]; }
  [[nodiscard]] const Points<Dim>& points() const { return mesh_.points; }
  [[nodiscard]] Vec<Dim> centroid(CellId c) const {
    Vec<Dim> x{};
    for (const VertexId v : cell(c)) x = x + (1.0 / (Dim + 1)) * mesh_.points[v];
    return x;
  }
  [[nodiscard]] AngleRange angles(const SimplexVertices<Dim>& v) const {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh_.points[v[k]];
    return angle_range<Dim>(p);
  }
  /// The other cell at the facet opposite to corner `corner`, or kNoCell on the hull or where no star tells.
  [[nodiscard]] CellId neighbour(CellId c, int corner) const;
  /// Cells that contain all the given vertices. \pre has_star(vertices[0])
  [[nodiscard]] std::vector<CellId> cells_around(std::span<const VertexId> vertices) const;

  /// Moves shall keep these. \param anchors by their points, ascending; outlive the object
  void guard(std::span<const Anchor> anchors) { anchors_ = anchors; }
  /// Whether there may be anchors in a box.
  [[nodiscard]] bool has_anchors(const Vec<Dim>& low, const Vec<Dim>& high) const;
  /// Whether the anchors that lie in cells of their material around a vertex, or are not to, would still do so with the
  /// vertex at x.
  /// \pre has_star(v)
  [[nodiscard]] bool keeps_anchors(VertexId v, const Vec<Dim>& x) const;

  /// Moves a vertex; it is safe to move vertices without a common cell at the same time, outside of transactions.
  void move(VertexId v, const Vec<Dim>& x) {
    if (recording_) moved_.push_back({v, mesh_.points[v]});
    mesh_.points[v] = x;
  }
  /// Gives a cell another material. Not part of a transaction.
  void relabel(CellId c, MaterialId material) { block_.materials[c] = material; }
  /// Puts cells in the place of others.
  void replace(std::span<const CellId> old_cells, std::span<const NewCell<Dim>> new_cells);
  /// Adds a vertex, with a star.
  VertexId add_vertex(const Vec<Dim>& x);

  /// Changes from begin() on are kept by commit() or taken back by rollback().
  void begin();
  void commit();
  void rollback();
  /// Cells that were written since begin() and are alive, each once.
  [[nodiscard]] std::vector<CellId> written() const;

  /// Appends the cells that are dead by now and the chosen vertices without a cell.
  void list_removed(Removed& removed) const;

  static constexpr CellId kNoCell = 0xffffffffU;

 private:
  static constexpr VertexId kNoVertex = 0xffffffffU;
  struct Star {
    std::uint32_t size = 0, capacity = 0;
    std::int64_t first = 0;
  };
  struct Written {
    CellId cell;
    NewCell<Dim> before;  // vertices[0] == kNoVertex: dead
  };
  /// Whether f(anchor) holds for one of the anchors in a box.
  template <class F>
  [[nodiscard]] bool any_anchor_in(const Vec<Dim>& low, const Vec<Dim>& high, F&& f) const;
  void collect(const Execution& execution);
  void write(CellId c, const NewCell<Dim>& cell);
  void insert(VertexId v, CellId c);
  void erase(VertexId v, CellId c);

  Mesh<Dim>& mesh_;
  CellBlock& block_;
  std::vector<VertexId> chosen_;
  std::span<const Anchor> anchors_;
  std::vector<std::uint8_t> fixed_;  // of every vertex; empty where all cells are simplices
  RawVector<std::uint32_t> slot_;    // of every vertex of the mesh: 1 + place in chosen_
  std::vector<Star> stars_;
  RawVector<CellId> pool_;
  std::vector<CellId> free_;
  bool recording_ = false;
  std::size_t points_at_begin_ = 0;
  std::vector<Written> log_;
  std::vector<std::pair<VertexId, Vec<Dim>>> moved_;
};

}  // namespace treemarch
