/// \file
/// Whether a mesh is what every stage promises.
#pragma once

#include <cstdint>
#include <string>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Counts of what is wrong with a mesh. Source: design, section 9.
struct MeshDefects {
  std::int64_t bad_cells = 0;  ///< with a vertex that does not exist, or twice the same; nothing else is counted
  std::int64_t unknown_materials = 0;   ///< cells whose material is no index into Mesh::labels
  std::int64_t inverted_cells = 0;      ///< some corner is not positive (of every corner of a hexahedron or pyramid)
  std::int64_t overused_facets = 0;     ///< shared by more than two cells
  std::int64_t folded_facets = 0;       ///< whose two cells lie on the same side
  std::int64_t unused_points = 0;       ///< of no cell
  std::int64_t coincident_points = 0;   ///< that repeat another one (within 1e-9 of the box's largest side)
  std::int64_t hull_facets = 0;         ///< with one cell; no defect
  std::int64_t facets_off_the_box = 0;  ///< with one cell and not on the points' bounding box (hanging nodes, holes)
  double volume = 0;                    ///< sum of the cells' signed volumes
  double box_volume = 0;                ///< of the points' bounding box

  /// No defect, though the mesh need not fill a box (a part of an image does not).
  [[nodiscard]] bool sound() const {
    return bad_cells + unknown_materials + inverted_cells + overused_facets + folded_facets + unused_points +
               coincident_points ==
           0;
  }
  /// Sound, closed and without a gap or overlap: fills its bounding box exactly, up to rounding.
  [[nodiscard]] bool fills_box() const;
  /// The defects in one line, or "sound".
  [[nodiscard]] std::string describe() const;
};

/// Examines a mesh of any cells with dimension(type) == Dim.
template <int Dim>
MeshDefects validate(const Mesh<Dim>& mesh, const Execution& execution);

}  // namespace treemarch
