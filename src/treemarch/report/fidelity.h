/// \file
/// Whether a mesh is true to its image.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/report/interface_distance.h"
#include "treemarch/report/topology_report.h"

namespace treemarch {

/// One label in the image and in the mesh.
struct LabelFidelity {
  std::int32_t label = 0;
  std::string name;                   ///< empty where the image has none
  std::int64_t voxels = 0;            ///< in the image
  std::int64_t cells = 0;             ///< in the mesh
  double image_volume = 0;            ///< of its voxels, physical
  double volume = 0;                  ///< of its cells, physical
  double dice = 0;                    ///< 2 |A n B| / (|A| + |B|), B: voxels whose centre lies in a cell of the label
  std::int64_t image_components = 0;  ///< connected over the faces of voxels
  std::int64_t components = 0;        ///< in the mesh, connected over the facets of cells
  bool is_background = false;         ///< left out of the mesh on purpose when it has no cell
};

struct Fidelity {
  std::vector<LabelFidelity> labels;          ///< of the image, by value
  std::int64_t unknown_cells = 0;             ///< cells with a label that the image lacks
  std::vector<InterfaceFidelity> interfaces;  ///< by their labels; where there is an image
  std::optional<TopologyReport> topology;     ///< where there is an image

  /// Labels with voxels but without cells, the background apart.
  [[nodiscard]] std::vector<std::int32_t> lost_labels() const;
  /// Mean of the Dice coefficients of all labels but the background.
  [[nodiscard]] double mean_dice() const;
};

/// Cells, volume and components of each label of a mesh, without an image.
template <int Dim>
Fidelity measure_labels(const Mesh<Dim>& mesh, const Execution& execution);

/// Compares a mesh with the image that it was made from. A voxel belongs to the cell that contains its centre; where
/// several do, its own material counts if it is among them, else the one that comes first in the image.
/// \param background label that may be missing from the mesh.
/// \param min_component voxels of a component that must survive as one.
/// \param borders those of the mesh, if they are known.
/// \pre the points are in the inner frame of the image. Labels are compared by value.
template <int Dim>
Fidelity measure_fidelity(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::int32_t background,
                          const Execution& execution, std::int64_t min_component = 8, const Borders* borders = nullptr);

}  // namespace treemarch
