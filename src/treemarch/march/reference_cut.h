/// \file
/// Cuts of earlier work, by labels at the vertices of a mesh, so that this project's can be compared with them
/// (docs/stages/references.md).
#pragma once

#include <cstdint>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Where a reference cuts an edge whose ends differ in their labels, a triangle of three and a tetrahedron of four.
enum class ReferencePlaces {
  /// In the middle: Nielson and Franke 1997, for any number of labels.
  middle,
  /// Where the labels of the corners weigh the same if weights are linear in between: marching tetrahedra with two
  /// labels (Nielson and Sung 1997), material fractions with more (in the manner of Bonnell et al.).
  equal_weights,
};

struct ReferenceReport {
  std::int64_t cut_edges = 0, triple_points = 0, inner_points = 0;
};

/// Gives every vertex the label that weighs most there (ties: the voxel's own, then the material that appears first),
/// and splits every simplex whose corners differ, so that each piece has one of their labels: a cut on each edge
/// between two labels, a triple point in each triangle and an inner point in each tetrahedron where all differ.
/// Diagonals follow the order of the vertices' numbers, as in Nielson and Sung, which makes neighbours agree. Labels
/// that win only between vertices are not seen. Vertices never lie on a surface: cuts keep 1/100 of the edge from its
/// ends, triple and inner points 1/20 in barycentric coordinates from the sides.
///
/// In: only simplices count, their materials do not. Out: conforming and positive if the input is, the same hull; old
/// points keep their numbers, then come cuts, triple points and inner points; pieces take the place of their simplex.
/// \return the mesh with the labels `image_labels`, a value a material
/// \throw Error(limits) for too many vertices
template <int Dim>
Mesh<Dim> cut_by_reference(const Mesh<Dim>& mesh, const Field<Dim>& field, ReferencePlaces places,
                           const std::vector<std::int32_t>& image_labels, ReferenceReport& report,
                           Execution& execution);

}  // namespace treemarch
