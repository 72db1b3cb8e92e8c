/// \file
/// Parts a material from itself, or joins it, where it touches itself at a vertex or an edge only.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/patch.h"
#include "treemarch/topology/vertex_link.h"

namespace treemarch {

/// Area (2D: length) of the facet opposite to a corner of a cell.
template <int Dim>
double facet_area(const Patch<Dim>& patch, CellId c, int corner);

/// Whether the cells of one material beside the given ones, which have it too, hang together without them, close by:
/// over facets, among the cells around their vertices. \pre !cells.empty(); their vertices have stars
template <int Dim>
bool keeps_connection(const Patch<Dim>& patch, std::span<const CellId> cells);

/// Counts how often materials touch themselves at a vertex of a patch.
template <int Dim>
class PinchCounter {
 public:
  explicit PinchCounter(const Patch<Dim>& patch) : patch_(patch) {}
  /// Sheets of boundaries at a vertex beyond one a material. \pre patch.has_star(v)
  int excess(VertexId v);

 private:
  const Patch<Dim>& patch_;
  VertexLink<Dim> link_;
};

struct UnpinchReport {
  std::vector<CellId> relabelled;  ///< in no order, some more than once
  std::int64_t left = 0;           ///< sheets beyond one a material
  bool confined = false;           ///< there might be a move for some of these if more vertices had stars
};

/// Relabels pieces of the stars of pinched vertices, as long as that makes the boundaries of the materials manifolds at
/// more vertices and disconnects nothing. Treats the vertices in their order, and those that are pinched by a move,
/// again and again while that helps. \param vertices ascending; have stars
/// \param kept cells that must not change, ascending
template <int Dim>
UnpinchReport unpinch(Patch<Dim>& patch, const Mesh<Dim>& mesh, const LabelImage<Dim>& image,
                      std::vector<VertexId> vertices, std::span<const CellId> kept, Execution& execution);

}  // namespace treemarch
