/// \file
/// Meshes from the coordinates of a file back to the inner frame.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/image/frame.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The inverse of to_world() for all points; cells are reordered where the frame is left-handed, so that they stay
/// positive. \param frame as output_frame() gives it.
template <int Dim>
void move_to_inner(Mesh<Dim>& mesh, const Frame<Dim>& frame, const Execution& execution);

}  // namespace treemarch
