/// \file
/// How far the interfaces of a mesh are from those between the voxels of its image.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {

/// The facets between two labels. Where the background has no cells, the facets that are not on a side of the box count
/// as interfaces with it.
struct InterfaceFidelity {
  std::int32_t first = 0, second = 0;  ///< labels, the smaller first
  double area = 0;                     ///< physical; 2D: length
  /// Distance from the middles of the facets, weighted by their area, to the nearest face between a voxel of the one
  /// and a voxel of the other label, physical. RMS and largest over the facets that have such a face within kReach
  /// voxels.
  double rms = 0, max = 0;
  double far_area = 0;  ///< of the facets that have none: the labels do not touch there in the image
  Vec<3> max_place{};   ///< world; z = 0 in 2D
};

/// Voxels around a facet that are searched, in each direction.
inline constexpr int kReach = 4;

/// All interfaces, by labels. The same for any number of threads.
/// \param borders the facets between materials and of the hull: MeshComponents::facets()
/// \param to_image as in component_fates()
template <int Dim>
std::vector<InterfaceFidelity> measure_interfaces(const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                                                  std::span<const MaterialId> to_image, std::int32_t background,
                                                  std::span<const BorderFacet> borders, const Execution& execution);

}  // namespace treemarch
