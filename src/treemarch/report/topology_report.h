/// \file
/// Whether a mesh has the topology of its image, and where not.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/component_fates.h"

namespace treemarch {

/// A component of the image that the mesh does not have as one component.
struct BrokenComponent {
  std::int32_t label = 0;
  std::int64_t voxels = 0;
  bool lost = false;  ///< else it is in several parts
  Vec<3> place{};     ///< world; centre of its first voxel, z = 0 in 2D
};

/// Two components of a label that touch in the image along an edge or at a corner of voxels only, but not in the mesh.
struct SeparatedContact {
  std::int32_t label = 0;
  std::int64_t voxels = 0;  ///< of the smaller one
  Vec<3> place{};           ///< world; the corner where they touch
};

/// A vertex at which the boundary of a label is no manifold.
struct PinchPlace {
  std::int32_t label = 0;
  bool in_image = false;  ///< the label's voxels touch themselves so too, among the cells around the vertex
  Vec<3> place{};         ///< world
};

struct TopologyReport {
  std::int64_t min_component = 8;
  /// Of at least min_component voxels, or the largest of a label without a cell: what must not be. Lost ones first, the
  /// largest first.
  std::vector<BrokenComponent> broken;
  std::vector<BrokenComponent> broken_small;  ///< those that are smaller, in the same order
  std::vector<SeparatedContact> separated;
  std::int64_t contacts = 0;  ///< pairs of components that touch along an edge or at a corner only
  std::vector<PinchPlace> pinches;
  std::int64_t image_pinches = 0;  ///< the same of the voxels themselves

  /// Components that are broken, and pinches that the image does not have.
  [[nodiscard]] bool breached() const;
  /// What is wrong in a few words, one line; empty unless breached().
  [[nodiscard]] std::string breach() const;
};

/// What else the report knows about the two.
template <int Dim>
struct TopologyInput {
  const LabelImage<Dim>& image;
  const UniformBlocks<Dim>& uniform;
  const Mesh<Dim>& mesh;
  const ComponentMap& map;
  const MeshComponents<Dim>& components;
  std::span<const ComponentFate> fates;
};

/// \param background its components may be missing, and its boundary is looked at only where the mesh has cells of it
template <int Dim>
TopologyReport report_topology(const TopologyInput<Dim>& input, std::int32_t background, std::int64_t min_component,
                               const Execution& execution);

}  // namespace treemarch
