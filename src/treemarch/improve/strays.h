/// \file
/// Small components of a mesh that no voxel of the image stands behind.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/improve/patch.h"
#include "treemarch/topology/image_components.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {

/// A component of a mesh without a vertex inside that contains the centre of no voxel of its label.
struct Stray {
  std::vector<CellId> cells;  ///< ascending
};

/// The components of a mesh without a vertex inside.
struct SmallPieces {
  /// Those without a voxel, by their first cells. Moved a little they would hold one, and be parts of a component that
  /// is elsewhere.
  std::vector<Stray> strays;
  /// For each component of the image in the others the centre of the voxel that is deepest in a cell. Moved a little
  /// they could lose all of them. Ascending by the first coordinate.
  std::vector<Anchor> anchors;
};

/// \param required one a component of the image: whether it gets an anchor
/// \pre as for repair_topology(); the components are those of the mesh and of the image
template <int Dim>
SmallPieces find_small_pieces(const LabelImage<Dim>& image, const ComponentMap& map,
                              std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                              const MeshComponents<Dim>& components, const Execution& execution);

/// Gives each of them to the material beside it with the largest area of facets, first to those that it does not join
/// to other components, unless that makes more vertices where boundaries are no manifolds. \param components before
/// anything was relabelled \param left_out a material of which all components may be joined, or kOutside \param patch
/// has the stars of their vertices \return the cells that changed
template <int Dim>
std::vector<CellId> relabel_strays(const std::vector<Stray>& strays, const MeshComponents<Dim>& components,
                                   MaterialId left_out, Patch<Dim>& patch);

}  // namespace treemarch
