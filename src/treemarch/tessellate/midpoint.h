/// \file
/// The paper's tessellation of a spacetree: midpoint rule, recursive in dimension, and templates for regular cells.
/// Source: paper, section "Non-uniform conforming meshing", figure 3.
#pragma once

#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/leaf_shapes.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// How a rectangle with hanging nodes on its rim is divided (3D and 4D).
enum class FacetRule {
  midpoint,  ///< its sides are joined to a vertex inside
  extended,  ///< triangles between its own vertices: fewer cells, smaller angles (extended template)
};

struct MidpointOptions {
  /// Regular cells (no hanging node on any edge) become 5 tetrahedra in 3D; false: the midpoint rule for all cells.
  bool templates = true;
  FacetRule facets = FacetRule::midpoint;
  /// One a leaf, as choose_leaf_shapes() gives them, or empty: all simplices. Dim 2 or 3.
  std::span<const LeafShape> shapes;
};

/// Fills the box with simplices, or in a hybrid mesh with boxes, pyramids and simplices, for any refinement pattern and
/// any balance.
///
/// Vertices are the corners of the leaves, the centres of the leaves that the midpoint rule divides and the centres of
/// the facets (in 4D: of the faces) that have hanging nodes, unless
/// `facets` is extended. They are numbered by
/// their position, first axis fastest. Cells of one type come in the order of the leaves, are positive, and carry the
/// material of their leaf. No choice depends on anything but the lattice, so that the result is the same for any number
/// of threads.
///
/// \return a block of each type of cell that there is; `labels` and `names` are left
/// empty for the caller, who knows the image. \throw Error(limits) with more vertices than VertexId can count.
template <int Dim>
Mesh<Dim> tessellate_midpoint(const Spacetree<Dim>& tree, const MidpointOptions& options, Execution& execution);

}  // namespace treemarch
