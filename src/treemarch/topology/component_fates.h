/// \file
/// What became of the components of an image in a mesh of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/image_components.h"
#include "treemarch/topology/mesh_components.h"
#include "treemarch/topology/plain_blocks.h"

namespace treemarch {

/// The components of the mesh that hold voxels of one component of the image: their smallest and largest number.
struct ComponentFate {
  static constexpr std::uint32_t kNone = 0xffffffffU;
  std::uint32_t first = kNone, last = 0;

  /// No voxel of it has its centre in a cell of its label.
  [[nodiscard]] bool lost() const { return first == kNone; }
  /// Its voxels lie in several components of the mesh.
  [[nodiscard]] bool split() const { return first != kNone && first != last; }
};

struct ComponentFates {
  std::vector<ComponentFate> of;  ///< one a component of the image
  /// The component of the mesh that has most of some cells of each material of the image, ComponentFate::kNone if these
  /// cells were all of other materials. The smallest of several.
  std::vector<std::uint32_t> main;
  std::vector<std::uint8_t> in_main;  ///< of each component of the image: whether voxels of it lie in such a one
  /// Cells, in their order, that do not lie in the main component of their material. Of materials that are one
  /// component of the mesh they are not listed.
  std::vector<CellPlace> elsewhere;
};

/// The fate of each component. A voxel belongs to the cells of its own label that contain its centre.
/// \param to_image the image's material of each material of the mesh, kOutside where the image lacks the label
/// \param plain blocks of the image beside the borders of these components; not looked at unless needs_plain_blocks()
/// \pre the points are in the inner frame of the image
template <int Dim>
ComponentFates component_fates(const LabelImage<Dim>& image, const ComponentMap& map, const Mesh<Dim>& mesh,
                               const MeshComponents<Dim>& components, const PlainBlocks<Dim>& plain,
                               std::span<const MaterialId> to_image, const Execution& execution);

/// Whether plain blocks save component_fates() time: cells are so large that there are several voxels a cell.
template <int Dim>
bool needs_plain_blocks(const LabelImage<Dim>& image, const Mesh<Dim>& mesh);

/// The image's material of each material of a mesh, kOutside where the image lacks the label.
std::vector<MaterialId> match_labels(const std::vector<std::int32_t>& mesh, const std::vector<std::int32_t>& image);

}  // namespace treemarch
