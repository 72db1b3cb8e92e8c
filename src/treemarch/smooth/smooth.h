/// \file
/// Smoothing with internal boundaries (paper section "Mesh smoothing").
#pragma once

#include <cstdint>
#include <limits>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

enum class Smoother : std::uint8_t {
  laplacian,  ///< towards the mean of the neighbours; shrinks
  taubin,     ///< the same, then a step away from it (lambda | mu): keeps the volume
};

struct SmoothOptions {
  int steps = 10;                        ///< of each subset; a step of Taubin's has two halves
  Smoother smoother = Smoother::taubin;  ///< of curves and interfaces; the volume is always smoothed by Laplace's
  double lambda = 0.33;                  ///< fraction of the way to the mean, in (0, 1]
  double mu = -0.34;                     ///< of Taubin's second half, in [-1, -lambda)
  /// Largest distance of a vertex from where it was, as a length of the inner frame.
  double max_displacement = std::numeric_limits<double>::infinity();
};

struct SmoothReport {
  struct Stage {
    std::int64_t vertices = 0;  ///< that may move
    std::int64_t moves = 0;     ///< made, some of them shortened
    std::int64_t refused = 0;   ///< not made, for the sake of an element
    double displacement = 0;    ///< largest distance from the start
  };
  Stage curves, interfaces, volume;
};

/// Smooths junction curves, then interfaces, then the volume (strata.h), each with the vertices of the earlier ones
/// fixed and with the neighbours of the same subset only. In 2D: interfaces, then the volume.
///
/// A vertex moves towards the mean of its neighbours, half or a quarter of the way if it may not go all of it. No move
/// inverts a cell. One of a curve or interface vertex makes no angle (3D: dihedral angle) smaller or larger than the
/// worst ones of the cells around the cells of the vertex before smoothing, one of a volume vertex none worse than the
/// worst of its own cells now: so the worst angles of the mesh never get worse. Vertices on the faces of the bounding
/// box stay on them, bit for bit. Means are taken of one state of the mesh, moves are judged one after the other
/// in blocks of space, which gives the same for any number of threads. \pre the mesh is conforming, positive and fills
/// its bounding box \throw Error(usage) for options out of range; Error(limits) for too many cells
template <int Dim>
SmoothReport smooth(Mesh<Dim>& mesh, const SmoothOptions& options, Execution& execution);

}  // namespace treemarch
