/// \file
/// The lattice of the default method: simplices between the corners and the centres of the leaves. The uniform case is
/// the body-centred cubic lattice of isosurface stuffing (Labelle and Shewchuk 2007). See docs/stages/lattice.md.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred_points.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// The vertices of the simplices that one leaf makes: those of its faces to upper neighbours of its size, to larger
/// neighbours and (3D) to the outside; in 2D those inside it.
template <int Dim>
struct LeafStar {
  static constexpr VertexId kNone = ~VertexId{0};
  static constexpr int kCorners = 1 << Dim, kFaces = 2 * Dim, kEdges = Dim == 3 ? 12 : 4;
  static constexpr int kMostSimplices = Dim == 3 ? 48 : 8;
  using Simplex = std::array<VertexId, Dim + 1>;

  VertexId centre;
  std::array<VertexId, kCorners> corner;  ///< bit d of the index is set at the upper end along axis d
  std::array<VertexId, kFaces> across;    ///< 2 axis + up: centre of the neighbour or of the hull's face, or kNone
  std::array<VertexId, kEdges> middle;    ///< hanging vertex of an edge, or kNone; valid if `hanging`
  unsigned split = 0;                     ///< faces to a larger neighbour, a bit each
  bool plain = false;                     ///< a finest leaf, neither on the hull nor beside a larger one
  unsigned up = 0;                        ///< bit d: the leaf lies at the upper end of its parent along axis d
  bool hanging = false;

  /// Number of the edge between two corners: along axis d, 4 d (2D: 2 d) and a bit for each other axis, in their order.
  static constexpr int edge_between(int a, int b) {
    const int axis = std::countr_zero(static_cast<unsigned>(a ^ b));
    int place = 0;
    for (int d = 0, bit = 0; d < Dim; ++d)
      if (d != axis) place |= (a >> d & 1) << bit++;
    return axis * (1 << (Dim - 1)) + place;
  }
  template <class Visit>
  void for_vertices(Visit&& visit) const {
    visit(centre);
    for (const VertexId v : corner) visit(v);
    for (const VertexId v : across)
      if (v != kNone) visit(v);
    if (hanging)
      for (const VertexId v : middle)
        if (v != kNone) visit(v);
  }
  /// Whether `test` holds for all vertices.
  template <class Test>
  [[nodiscard]] bool all_of(Test&& test) const {
    bool all = true;
    for_vertices([&](VertexId v) { all &= test(v); });
    return all;
  }
  /// Lists the simplices, one face after the other, and returns how many there are.
  int simplices(std::array<Simplex, kMostSimplices>& out) const;
  /// Those of one face alone.
  int simplices(int face, std::array<Simplex, kMostSimplices>& out) const;
  /// The corners of a face in the order in which they go around it: counter-clockwise about its axis.
  [[nodiscard]] std::array<VertexId, kCorners / 2> rim(int face) const;
  /// Whether a vertex hangs on the rim of a face.
  [[nodiscard]] bool is_halved(int face) const;
  /// All corners in the order of a quad or hexahedron.
  [[nodiscard]] std::array<VertexId, kCorners> box() const;
  /// Calls visit(u, v) for edges of the lattice around the leaf. Over all leaves every edge is met, most of them once.
  template <class Visit>
  void for_edges(Visit&& visit) const {
    for (const VertexId v : corner) visit(centre, v);
    if (plain) {
      for (const VertexId v : across)
        if (v != kNone) visit(centre, v);
      for (int d = 0; d < Dim; ++d) visit(corner[0], corner[1 << d]);
      return;
    }
    for (int a = 0; a < kCorners; ++a)
      for (int d = 0; d < Dim; ++d) {
        const int b = a | 1 << d;
        if (a == b) continue;
        const VertexId m = hanging ? middle[edge_between(a, b)] : kNone;
        visit(corner[a], m == kNone ? corner[b] : m);
        if (m != kNone) visit(m, corner[b]);
      }
    std::array<Simplex, kMostSimplices> listed;
    const int count = simplices(listed);
    for (int s = 0; s < count; ++s)
      for (int i = 0; i < Dim; ++i)
        for (int j = i + 1; j <= Dim; ++j) visit(listed[s][i], listed[s][j]);
  }
};

/// A conforming simplicial mesh whose vertices have integer coordinates, in half sides of a finest cell. Its simplices
/// are not stored: each leaf gives its own.
template <int Dim>
struct SimplexLattice {
  RawVector<Coord<Dim>> vertices;     ///< integer coordinates: the identity of a vertex
  std::vector<std::uint8_t> spacing;  ///< log2 of the side of the smallest leaf at each vertex
  std::vector<Leaf<Dim>> leaves;      ///< as in the tree
  std::vector<std::int32_t> sides;    ///< of the leaves of each level, in finest cells
  BodyCentredPoints<Dim> points;      ///< numbers the vertices
  Vec<Dim> unit{};                    ///< physical length of one coordinate step
  Coord<Dim> extent{};                ///< coordinates of the upper corner of the box

  [[nodiscard]] Vec<Dim> point(VertexId v) const {
    Vec<Dim> x{};
    for (int d = 0; d < Dim; ++d) x[d] = vertices[v][d] * unit[d];
    return x;
  }
  /// Bit d is set where vertex v lies on a side of the box that is normal to axis d: it must not move along d.
  [[nodiscard]] unsigned hull_axes(VertexId v) const {
    unsigned axes = 0;
    for (int d = 0; d < Dim; ++d)
      if (vertices[v][d] == 0 || vertices[v][d] == extent[d]) axes |= 1U << d;
    return axes;
  }
  [[nodiscard]] LeafStar<Dim> star(LeafId leaf) const;
};

/// Joins the corners and centres of the leaves of a 2:1 balanced tree, Dim 2 or 3. Angles for cubic leaves: in 3D
/// dihedral angles of 60 to 90 degrees where the tree is uniform, 45 to 120 everywhere; in 2D angles of 45 to 90.
/// \pre every factor of the tree's pattern is 2; is_balanced(tree, 1).
/// \throw Error(limits) if there are 2^32 vertices or more.
template <int Dim>
SimplexLattice<Dim> tessellate_body_centred(Spacetree<Dim> tree, Execution& execution);

}  // namespace treemarch
