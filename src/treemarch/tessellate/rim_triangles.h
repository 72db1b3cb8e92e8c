/// \file
/// Rectangles with hanging nodes on their rim, divided without a vertex inside.
/// Source: paper, figure 3 c (extended template).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/vec.h"

namespace treemarch {

struct RimTriangles {
  std::vector<std::array<std::uint16_t, 3>> triangles;  ///< positions in the rim, in its sense of rotation
  double largest_cosine = -1;                           ///< of all their angles: that of the smallest angle
};

/// The triangulation of a convex polygon without inner vertices whose smallest angle is largest; of equally good ones
/// always the same. Vertices may lie on straight sides. Cubic in their number.
/// \param rim at least 3 vertices in order around the polygon, not all on one line.
RimTriangles triangulate_rim(std::span<const Vec<2>> rim);

}  // namespace treemarch
