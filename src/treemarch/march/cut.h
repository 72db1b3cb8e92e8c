/// \file
/// The default cut: splits a lattice along the interfaces of any number of materials in one pass, with a proved bound
/// on the angles. The idea of snapping and of clamped cuts is that of isosurface stuffing (Labelle and Shewchuk 2007).
/// See docs/stages/cut.md.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/march/left_out.h"
#include "treemarch/march/snap.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

struct CutOptions {
  /// Simplices of this material far from interfaces are not written (march/left_out.h); kOutside: all are.
  MaterialId left_out = kOutside;
  SnapOptions snap;
  /// No stencil is left with a quality (mesh/simplex_quality.h) below this, in degrees. At most the bound of the
  /// undisplaced stencils: 18.43 on trees with cubic cells, 30 where the tree is uniform.
  double quality_floor = 18;
};

struct CutReport {
  std::int64_t lattice_vertices = 0;
  std::int64_t lattice_simplices = 0;  ///< those that are left out, too
  std::int64_t band_simplices = 0;     ///< of these, near interfaces
  std::int64_t far_cells = 0;  ///< the first so many cells of the mesh are simplices of the lattice as they were;
                               ///< their vertices have no cell of another material
  /// One a vertex of the mesh: 0 where all cells around it are of one material, for certain.
  std::vector<std::uint8_t> at_interfaces;
  LeftOutPlaces left_out;  ///< on the lattice
  std::int64_t cut_edges = 0, triple_points = 0, inner_points = 0;
  std::int64_t snapped_vertices = 0;
  std::int64_t retreated_points = 0;
  int retreat_rounds = 0;
};

/// Cuts a lattice. The mesh has the materials `labels` of the image, every interface is a union of facets, and its hull
/// is the lattice's box, but for what is left out. Cells far from interfaces come first, then all others.
/// \param image_labels the image's value of each material, copied into the mesh. \pre options.quality_floor is at most
/// the bound of the lattice's undisplaced stencils.
template <int Dim>
Mesh<Dim> cut_lattice(const SimplexLattice<Dim>& lattice, const Field<Dim>& field,
                      const std::vector<std::int32_t>& image_labels, const CutOptions& options, CutReport& report,
                      Execution& execution);

}  // namespace treemarch
