/// \file
/// Small components of a mesh that no voxel of the image stands behind.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/patch.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {

/// A component of a mesh without a vertex inside that contains the centre of no voxel of its label.
struct Stray {
  std::vector<CellId> cells;  ///< ascending
};

/// By their first cells. Moved a little they would hold a voxel, and be parts of a component that is elsewhere.
/// \pre as for repair_topology(); the components are those of the mesh
template <int Dim>
std::vector<Stray> find_strays(const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                               const MeshComponents<Dim>& components, const Execution& execution);

/// Gives each of them to the material beside it with the largest area of facets, first to those that it does not join
/// to other components, unless that makes more vertices where boundaries are no manifolds. \param components before
/// anything was relabelled \param left_out a material of which all components may be joined, or kOutside \param patch
/// has the stars of their vertices \return the cells that changed
template <int Dim>
std::vector<CellId> relabel_strays(const std::vector<Stray>& strays, const MeshComponents<Dim>& components,
                                   MaterialId left_out, Patch<Dim>& patch);

}  // namespace treemarch
