/// \file
/// Moves the vertices of boxes at interfaces towards the interface: the geometry-adapted hexahedral mesh (Camacho,
/// Hopper, Lin, Myers, van Bruggen 1997; Wolters, Anwander, Berti, Hartmann 2007), towards the surface of a field
/// rather than the centroids of the minority's voxels. See docs/stages/hybrid.md.
#pragma once

#include <cstdint>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct ShiftOptions {
  double most = 0;  ///< a vertex moves by at most this part of the smallest cell around it, along each axis; below 1/2
  /// Every cell keeps this part of its scaled Jacobian (mesh/cell_topology.h), hence no corner is inverted, and of the
  /// ratio of its smallest Jacobian to its largest.
  double keep = 0.15, keep_ratio = 0.05;
};

struct ShiftReport {
  std::int64_t vertices = 0;   ///< on interfaces
  std::int64_t shifted = 0;    ///< of these, moved
  std::int64_t held_back = 0;  ///< moved less than they could, for the sake of a cell
};

/// Moves every vertex between two or more materials to where their weights are equal, or as far as that is allowed.
/// Vertices on a side of the bounding box stay on it. Where a cell would lose too much of its shape, all its vertices
/// go back a step, until none does; then those that went back without need go on again. The result is the same for any
/// number of threads. \pre the mesh is conforming, its cells are positive and it fills its bounding box.
template <int Dim>
ShiftReport shift_vertices(Mesh<Dim>& mesh, const Field<Dim>& field, const ShiftOptions& options, Execution& execution);

}  // namespace treemarch
