/// \file
/// Step B of the default cut: where edges cross interfaces, and vertices moved onto interfaces and junctions nearby.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/field/field.h"
#include "treemarch/march/edge_table.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

struct SnapOptions {
  int rounds = 3;
  double short_edge = 0.41;        ///< a cut closer than this part of an edge attracts the vertex
  double long_edge = 0.25;         ///< the same for axis-parallel edges
  double max_displacement = 0.36;  ///< of the side of the smallest leaf at the vertex
};

/// The lattice after snapping.
template <int Dim>
struct SnappedLattice {
  VertexLabels labels;           ///< grown by the labels that a vertex was snapped to
  std::vector<Vec<Dim>> points;  ///< of the vertices with several labels, by the number of their set; others stay
  EdgeTable edges;               ///< separated before snapping
  /// Where an edge that is still separated is cut: the fraction from its lower to its upper vertex, at a distance from
  /// both ends; negative where the edge is not cut.
  RawVector<float> cut;
  std::int64_t snapped = 0;  ///< vertices that moved

  [[nodiscard]] Vec<Dim> point(const SimplexLattice<Dim>& lattice, VertexId v) const {
    return labels.single(v) ? lattice.point(v) : points[labels.set_number(v)];
  }
};

/// Jacobi rounds, so that the result depends on no order. Vertices on the hull stay within their face, edge or corner.
template <int Dim>
SnappedLattice<Dim> snap_vertices(const SimplexLattice<Dim>& lattice, VertexLabels&& labels, const Field<Dim>& field,
                                  const SnapOptions& options, Execution& execution);

}  // namespace treemarch
