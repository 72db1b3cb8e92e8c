/// \file
/// The lattice of the default method: simplices between the corners and the centres of the leaves. The uniform case is
/// the body-centred cubic lattice of isosurface stuffing (Labelle and Shewchuk 2007). See docs/stages/lattice.md.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// A conforming simplicial mesh whose vertices have integer coordinates, in half sides of a finest cell.
template <int Dim>
struct SimplexLattice {
  std::vector<Coord<Dim>> vertices;                      ///< integer coordinates: the identity of a vertex
  std::vector<std::uint8_t> spacing;                     ///< log2 of the side of the smallest leaf at each vertex
  std::vector<std::array<VertexId, Dim + 1>> simplices;  ///< positive
  Vec<Dim> unit{};                                       ///< physical length of one coordinate step
  Coord<Dim> extent{};                                   ///< coordinates of the upper corner of the box

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
};

/// Joins the corners and centres of the leaves of a 2:1 balanced tree, Dim 2 or 3. Angles for cubic leaves: in 3D
/// dihedral angles of 60 to 90 degrees where the tree is uniform, 45 to 120 everywhere; in 2D angles of 45 to 90.
/// \param skip one a leaf, or empty: leaves that are not needed. A simplex is left out when every leaf that it lies in
/// is
///   skipped; vertices are kept.
/// \pre every factor of the tree's pattern is 2; is_balanced(tree, 1).
/// \throw Error(limits) if there are 2^32 vertices or more.
template <int Dim>
SimplexLattice<Dim> tessellate_body_centred(const Spacetree<Dim>& tree, const std::vector<std::uint8_t>& skip,
                                            Execution& execution);

}  // namespace treemarch
