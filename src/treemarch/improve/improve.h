/// \file
/// Raises the worst elements of a mesh of simplices above a target, without making its interfaces less true.
/// Smart smoothing after Freitag and Ollivier-Gooch (1997). See docs/stages/improve.md.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct ImproveOptions {
  double quality = 20;  ///< target in degrees (mesh/simplex_quality.h); 0 leaves the elements as they are
  /// Of a vertex from where it was, physical. 0: half the smallest side of a voxel or, if that is more, a quarter of
  /// the shortest edge at the vertex, a half within a material.
  double max_displacement = 0;
  double seconds = 0;           ///< stops after so long (then the result depends on the machine); 0 for no limit
  int passes = 20;              ///< of operations that change the connectivity, at most
  std::int64_t first_cell = 0;  ///< cells before it meet the target and touch no interface but at vertices of others
  bool keep_numbers = false;    ///< vertices that no cell needs any more stay in `points`
  std::span<const Anchor> anchors;  ///< that moves shall keep, by their points
  bool pull = true;                 ///< bring vertices that lie off their interface back to it where quality allows
  double longest_pulled = 0;        ///< but not those whose edges are longer on average (fit.h moves them); 0: all
};

enum class ImproveStop { off, target_met, no_progress, pass_limit, time_limit };

/// One word for a report.
[[nodiscard]] std::string_view name_of(ImproveStop stop);

struct ImproveReport {
  ImproveStop stopped = ImproveStop::off;
  std::int64_t below_before = 0, below_after = 0;  ///< elements below the target
  double worst_before = 0, worst_after = 0;        ///< smallest quality, in degrees; the target where none is below it
  std::int64_t moves = 0;                          ///< of vertices, to a better place
  std::int64_t facet_flips = 0, edge_removals = 0, collapses = 0, splits = 0;
  std::int64_t pulls = 0;  ///< vertices brought back to their interface
  int passes = 0;
};

/// Improves a mesh in place. Quality never falls: the worst element of every neighbourhood that is touched gets better,
/// or (pull) stays at or above the target. Materials, hull and the topology of interfaces are kept; cells and vertices
/// may be added and removed.
///
/// A vertex belongs to the stratum given by the materials and the sides of the box around it and leaves it by less than
/// a tenth of a voxel. Facets with one cell that do not lie on the box are interfaces to what was left out of the mesh.
/// \param box the upper corner of the image's box, the lower one is 0; vertices on it have exactly its coordinates, up
/// to rounding.
/// Cells other than simplices, and their vertices, stay as they are.
/// \pre simplices come first and are positive.
/// \throw Error(usage) if the target is above 60.
/// The result is the same for any number of threads, unless options.seconds ends it.
template <int Dim>
ImproveReport improve(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const ImproveOptions& options,
                      Execution& execution);

}  // namespace treemarch
