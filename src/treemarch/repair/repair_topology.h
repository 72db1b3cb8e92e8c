/// \file
/// Gives a mesh the topology of its image where the cut did not: relabels a few cells. See docs/stages/topology.md.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/march/left_out.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct RepairOptions {
  std::int64_t min_component = 8;  ///< voxels of a component that must survive as one
  MaterialId left_out = kOutside;  ///< of this material, which the mesh holds in part only, no component is asked for
  /// So many first cells have no vertex with a cell of another material.
  std::int64_t uniform_cells = 0;
  /// One a vertex: 0 where all cells around it are of one material, for certain; empty where nothing is known.
  std::span<const std::uint8_t> at_interfaces;
  int rounds = 4;  ///< of looking for breaches and mending them, at most
};

struct RepairReport {
  int rounds = 0;
  std::int64_t pinches_before = 0, pinches_after = 0;  ///< sheets of boundaries at vertices beyond one a material
  std::int64_t restored = 0;                           ///< components that had no cell
  std::int64_t bridged = 0;                            ///< parts of components that were joined to the rest
  std::int64_t relabelled_cells = 0;
  /// Of the components that must survive and have no vertex inside, and between the parts of one material: later moves
  /// shall keep them. By their points, ascending.
  std::vector<Anchor> anchors;
};

/// Relabels cells so that every label has a cell, every component of the image of at least options.min_component voxels
/// is one component of the mesh, and the boundary of every material is a manifold. No vertex moves and no cell changes
/// its shape. What cannot be mended stays as it is. The result is the same for any number of threads.
/// \param left_out cells of options.left_out that the mesh lacks; those that are needed are added to it
/// \pre the mesh has one block, of simplices, which fill the image's box together with those that are left out; its
/// materials are those of the image; its points are in the image's inner frame.
template <int Dim>
RepairReport repair_topology(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const RepairOptions& options,
                             Execution& execution, LeftOutCells<Dim>* left_out = nullptr);

}  // namespace treemarch
