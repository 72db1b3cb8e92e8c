/// \file
/// Lays the facets between materials where they are true to the image on average, not at their corners alone.
/// See docs/stages/improve.md.
#pragma once

#include <cstdint>
#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

struct FitOptions {
  double quality = 20;  ///< in degrees (mesh/simplex_quality.h): cells around a vertex that moves have it; 0: no moves
  MaterialId outside = kOutside;     ///< the material that was left out of the mesh, if any
  std::span<const Anchor> anchors;   ///< that moves shall keep, by their points
  const Borders* borders = nullptr;  ///< of the mesh; looked for where they are not given
};

struct FitReport {
  std::int64_t facets = 0;  ///< that are large enough to be fitted
  std::int64_t moves = 0;   ///< of vertices
  /// Distance between these facets and the interface they follow, physical; afterwards as the last measurement and the
  /// moves since then tell.
  double rms_before = 0, rms_after = 0;
};

/// Moves the vertices of interfaces such that the facets around them have the least squared distance from the interface
/// of the image, measured all over the facets: a flat facet with its corners on a curved interface lies on one side of
/// it. Small facets follow the field, facets of several voxels the voxels themselves. Vertices
/// with small facets, 1.25 voxels on average, are left alone. Vertices on the box stay on their sides of it; nothing
/// but positions changes. The same result for any number of threads. \param box the upper corner of the image's box,
/// the lower one is 0. \pre as for improve(): simplices come first and are positive.
template <int Dim>
FitReport fit_interfaces(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const FitOptions& options,
                         Execution& execution);

}  // namespace treemarch
