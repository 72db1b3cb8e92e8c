/// \file
/// The methods behind mesh_image(): each is the ordered list of its stages, from an image to a mesh.
#pragma once

#include <optional>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {

/// The paper's method (docs/stages/march-paper.md). Meshes the background too.
template <int Dim>
Mesh<Dim> mesh_by_paper(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                        Execution& execution);

/// One of the references (docs/stages/references.md). Meshes the background too.
template <int Dim>
Mesh<Dim> mesh_by_reference(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                            Execution& execution);

/// Space and time (docs/stages/space-time.md): the paper's method as far as it goes in four dimensions. Meshes the
/// background too. \throw Error(usage) for what is not done there.
Mesh<4> mesh_space_time(const LabelImage<4>& image, const MeshOptions& options, Execution& execution);

/// The method with bounded angles (docs/stages/cut.md). Leaves the background out unless it is to be kept.
/// \param borders those of the mesh, if they are found on the way
template <int Dim>
Mesh<Dim> mesh_with_guarantee(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                              GuaranteeReport& report, std::optional<Borders>& borders, Execution& execution);

/// Hexahedra that follow the lattice of the image, their vertices shifted onto interfaces (docs/stages/hybrid.md).
/// Meshes the background too.
template <int Dim>
Mesh<Dim> mesh_by_boxes(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                        ShiftReport& report, Execution& execution);

}  // namespace treemarch
