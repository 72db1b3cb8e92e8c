/// \file
/// The methods behind mesh_image(): each is the ordered list of its stages, and meshes the background too.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {

/// The paper's method (docs/stages/paper_march.md).
template <int Dim>
Mesh<Dim> mesh_by_paper(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution);

/// The method with bounded angles.
template <int Dim>
Mesh<Dim> mesh_with_guarantee(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution);

}  // namespace treemarch
