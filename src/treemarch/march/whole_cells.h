/// \file
/// Which simplices of a lattice become pyramids and boxes in a hybrid mesh. See docs/stages/hybrid.md.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

struct WholeCellOptions {
  /// What pyramids and boxes have at least: scaled Jacobian (mesh/cell_topology.h) and quality of their angles, degrees
  /// (mesh/simplex_quality.h). Those of cubic cells have 0.57, 1 and 45.
  double jacobian = 0.2, quality = 20;
};

/// Puts pyramids and boxes into the place of simplices of the lattice that are still cells of the mesh, wherever their
/// vertices are by now: the simplices around a face between two leaves become two pyramids if all of them are there and
/// of one material, no vertex hangs on the rim, and the pyramids have a good shape; a leaf all of whose faces are whole
/// becomes a hexahedron, if that has a good shape, and needs no pyramids. In 2D leaves become quads or stay simplices.
/// Interfaces stay facet for facet what they are. Pyramids and boxes come after all simplices, points stay.
/// \pre all cells are simplices; vertex v of the lattice, if it has cells, is vertex v of the mesh.
/// The result is the same for any number of threads.
template <int Dim>
void keep_whole(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, const WholeCellOptions& options,
                Execution& execution);

}  // namespace treemarch
