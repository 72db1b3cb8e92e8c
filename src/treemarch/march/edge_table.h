/// \file
/// The edges of a lattice that join vertices without a common label, as flat arrays.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

using EdgeId = std::uint32_t;
inline constexpr EdgeId kNoEdge = 0xffffffffU;

/// Edges in the order of their lower vertex, then of their upper one.
struct EdgeTable {
  std::vector<EdgeId> first;         ///< edges of lower vertex v are first[v] .. first[v + 1]
  std::vector<VertexId> lower;       ///< of each edge
  std::vector<VertexId> upper;       ///< of each edge, ascending within a lower vertex
  std::vector<EdgeId> first_upward;  ///< the same for upper vertices, into upward
  std::vector<EdgeId> upward;        ///< edges by their upper vertex
  std::vector<std::uint32_t> mixed;  ///< simplices with an edge of the table, ascending
  /// Whether a vertex lies in a simplex with one label only: then the label does not depend on this vertex alone.
  std::vector<std::uint8_t> supported;

  [[nodiscard]] std::size_t size() const { return upper.size(); }
  /// \return kNoEdge if the two vertices are not joined by an edge of the table.
  [[nodiscard]] EdgeId find(VertexId u, VertexId v) const {
    if (u > v) std::swap(u, v);
    for (EdgeId e = first[u]; e < first[u + 1]; ++e)
      if (upper[e] == v) return e;
    return kNoEdge;
  }
  /// Calls f(edge, the other end) for every edge at v.
  template <class F>
  void for_edges_at(VertexId v, F&& f) const {
    for (EdgeId e = first[v]; e < first[v + 1]; ++e) f(e, upper[e]);
    for (EdgeId k = first_upward[v]; k < first_upward[v + 1]; ++k) f(upward[k], lower[upward[k]]);
  }
};

/// \throw Error(limits) if there are 2^32 edges or simplices or more.
template <int Dim>
EdgeTable separated_edges(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, Execution& execution);

}  // namespace treemarch
