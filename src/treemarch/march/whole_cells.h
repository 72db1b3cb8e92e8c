/// \file
/// What of a cut lattice stays whole in a hybrid mesh. See docs/stages/hybrid.md.
#pragma once

#include <cstdint>
#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// Puts pyramids and boxes into the place of simplices that the cut has left as they were in the lattice: the simplices
/// around a face between two leaves become two pyramids if all of them are there, all cells around their vertices are
/// of one material, and no vertex hangs on the rim; a leaf all of whose faces stay whole becomes a hexahedron and needs
/// no pyramids. In 2D leaves become quads or stay simplices. No vertex of the new cells has moved; those without a cell
/// stay in `mesh.points`. \param first_far as in CutReport: where the cells that are simplices of the lattice are found
/// \return how many simplices of the lattice stay: the first cells of the mesh
/// \pre mesh is what cut_lattice() made of the lattice, cells perhaps relabelled since
template <int Dim>
std::int64_t keep_whole(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, std::span<const std::int64_t> first_far,
                        Execution& execution);

}  // namespace treemarch
