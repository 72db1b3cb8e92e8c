/// \file
/// Connected components of the materials of a mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Number of components of each material, its cells connected over facets. The same for any number of threads.
/// \pre the mesh is sound (mesh/validate.h)
template <int Dim>
std::vector<std::int64_t> count_mesh_components(const Mesh<Dim>& mesh, const Execution& execution);

}  // namespace treemarch
