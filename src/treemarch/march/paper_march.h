/// \file
/// Marching simplices for several materials by iterated two-material separation (paper sections 2.3 and 3).
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/march/separate.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

template <int Dim>
struct PaperMarchOptions {
  /// Materials in the order in which they are separated from the rest; those not named follow by id.
  std::vector<MaterialId> order;
  /// A vertex whose cut is nearer than this fraction of the edge is moved onto the surface; 0 moves none, < 1/2.
  double snap = 0.3;
  /// A vertex lies on the surface if f differs from 1/2 by no more than this.
  double tolerance = 1e-6;
  /// Whether the surface between two materials is separated in the turn of both, as in the paper, or of the first
  /// alone: then vertices that touch the material and just one of an earlier turn count as on the surface. Revisiting
  /// moves a surface by a little and so makes slivers.
  bool revisit = false;
  /// Separating function by position; empty for solid angles on the current mesh (paper eq. 2; 2D and 3D only).
  MaterialField<Dim> field;
};

struct PaperMarchReport {
  std::vector<std::int64_t> cells_before, cells_after;  ///< of each material
  std::vector<MaterialId> lost;                         ///< had cells before and have none now
  std::int64_t split_cells = 0;                         ///< cells that were cut, counted in each separation
  std::int64_t cuts = 0;                                ///< new vertices
  std::int64_t snapped = 0;                             ///< vertices moved onto a surface
  std::int64_t kept = 0;        ///< vertices taken as on the surface unmoved, since a piece would have been flat
  std::int64_t reassigned = 0;  ///< cells or parts of cells that fell to the majority of their neighbours
};

/// Separates each material m from the rest along f_m = 1/2, one after the other on the mesh as the earlier ones left
/// it. With two materials in all there is one surface and one separation.
///
/// f_m at a vertex that touches cells of one material is 1 or 0, at others the share of the solid angle or
/// options.field, so the surface stays within the cells that touch it. A part of an m-cell outside goes to the material
/// with the largest common facet area (ties: smaller id); a part of another cell inside becomes m. Cuts are placed by
/// linear interpolation, once an edge; new vertices are numbered by their edges, pieces take the place of their cell.
/// Hull vertices move, and hull edges are cut, only within the faces of the bounding box on which they lie.
///
/// Out: positive, conforming, the same volume and hull. The cost is linear in the mesh plus the cells at the interfaces
/// of each material. Materials may get lost; the report names them.
/// \pre the mesh is conforming, positive and fills its bounding box; materials index mesh.labels
/// \throw Error(limits) if a cell that is no simplex touches two materials, or for too many vertices;
///        Error(usage) for options out of range
template <int Dim>
PaperMarchReport march_materials(Mesh<Dim>& mesh, const PaperMarchOptions<Dim>& options, Execution& execution);

}  // namespace treemarch
