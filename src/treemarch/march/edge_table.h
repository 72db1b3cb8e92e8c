/// \file
/// The edges of a lattice that join vertices without a common label, as flat arrays.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/ranked_bits.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

using EdgeId = std::uint32_t;
inline constexpr EdgeId kNoEdge = 0xffffffffU;
/// Number of a vertex among the ends of separated edges, ascending with the vertex.
using EndId = std::uint32_t;

/// Edges in the order of their lower vertex, then of their upper one.
struct EdgeTable {
  RankedBits ends;                   ///< of edges, numbered
  RawVector<VertexId> vertex;        ///< of each end
  std::vector<EdgeId> first;         ///< edges whose lower vertex is end k are first[k] .. first[k + 1]
  RawVector<EndId> lower;            ///< of each edge
  RawVector<EndId> upper;            ///< of each edge, ascending within a lower end
  std::vector<EdgeId> first_upward;  ///< the same for upper ends, into upward
  RawVector<EdgeId> upward;          ///< edges by their upper end
  /// Whether an end lies in a simplex with one label only: then the label does not depend on this vertex alone.
  RawVector<std::uint8_t> supported;
  /// Vertices of the simplices with an end of one label that is not supported, Dim + 1 each.
  std::vector<VertexId> thin;

  [[nodiscard]] std::size_t size() const { return upper.size(); }
  [[nodiscard]] EndId end_of(VertexId v) const { return ends.rank(v); }
  [[nodiscard]] VertexId lower_vertex(EdgeId e) const { return vertex[lower[e]]; }
  [[nodiscard]] VertexId upper_vertex(EdgeId e) const { return vertex[upper[e]]; }
  /// \pre the two vertices are joined by an edge of the table.
  [[nodiscard]] EdgeId find(VertexId u, VertexId v) const {
    if (u > v) std::swap(u, v);
    const EndId high = end_of(v);
    EdgeId e = first[end_of(u)];
    while (upper[e] != high) ++e;
    return e;
  }
  /// Calls f(edge, the other end) for every edge at an end.
  template <class F>
  void for_edges_at(EndId k, F&& f) const {
    for (EdgeId e = first[k]; e < first[k + 1]; ++e) f(e, upper[e]);
    for (EdgeId i = first_upward[k]; i < first_upward[k + 1]; ++i) f(upward[i], lower[upward[i]]);
  }
};

/// \throw Error(limits) if there are 2^32 edges or more.
template <int Dim>
EdgeTable separated_edges(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, Execution& execution);

}  // namespace treemarch
