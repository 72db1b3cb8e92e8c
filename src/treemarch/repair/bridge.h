/// \file
/// Brings back components of the image that a mesh lost and joins those that it broke apart.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/improve/patch.h"
#include "treemarch/repair/repair_topology.h"
#include "treemarch/topology/component_fates.h"

namespace treemarch {

/// Components of the image that are lost or in parts, with what is needed to mend them. Refers to `components`.
template <int Dim>
struct BrokenComponents {
  /// A component of the mesh that holds voxels of a component of the image.
  struct Part {
    std::uint32_t image_component, mesh_component;
    std::int64_t hits;  // a measure of its size; that of the main part of a material is the largest
    CellId seed;        // one of its cells, but of the main part
  };
  /// A cell that contains the centre of a voxel of a lost component.
  struct Lost {
    std::uint32_t image_component;
    std::int64_t voxel;
    CellId cell;
  };
  std::vector<Part> parts;    ///< by component of the image, the largest part of it first
  std::vector<Lost> lost;     ///< by component of the image, then by voxel
  std::vector<CellId> cells;  ///< that may have to be worked on: those of the smaller parts and of the lost
  const MeshComponents<Dim>* components = nullptr;
  const ComponentMap* map = nullptr;
  const LabelImage<Dim>* image = nullptr;
  MaterialId left_out = kOutside;  ///< may be cut in two
  std::vector<CellId> kept;        ///< ascending: each stands for a component that is small, and is not lost

  [[nodiscard]] bool empty() const { return parts.empty() && lost.empty(); }
};

/// \param required one a component of the image: those with 0 are left as they are
/// \param left_out a material that is not part of the mesh in the end, or kOutside
/// \pre as repair_topology(); the arguments outlive the result
template <int Dim>
BrokenComponents<Dim> find_broken(const LabelImage<Dim>& image, const ComponentMap& map,
                                  std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                                  const MeshComponents<Dim>& components, const ComponentFates& fates,
                                  MaterialId left_out, const Execution& execution);

struct Mended {
  std::vector<CellId> relabelled;
  std::vector<HeldAnchor> restored;  ///< each stands for a component that had been lost
  bool surely_whole = true;          ///< and no other material was cut in two, as far as can be seen from nearby
};

/// Gives each lost component the cells around the centre of its innermost voxel and those of which its voxels are half,
/// and joins the parts of the others by the shortest ways over facets, through cells in the component's own voxels
/// where there is a choice. \param patch has the stars of the vertices around broken.cells
template <int Dim>
Mended mend_components(Patch<Dim>& patch, const BrokenComponents<Dim>& broken, RepairReport& report);

}  // namespace treemarch
