/// \file
/// Meshes against shapes that are known exactly.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <vector>

#include "treemarch/image/label_image.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch::testing {

using Level = std::function<double(const Vec<3>&)>;  // signed distance, negative inside

/// Label 1 where the distance is negative at the voxel centre, else 0.
inline LabelImage<3> voxelised(std::int32_t side, const Level& distance) {
  const Coord<3> extent{side, side, side};
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    values.push_back(distance({c[0] + 0.5, c[1] + 0.5, c[2] + 0.5}) < 0);
  }
  return make_label_image(extent, values);
}

struct SurfaceError {
  double distance = 0, normal = 0;  // RMS, in voxels and degrees
};

/// Of the interface facets of a mesh against a level set whose gradient has unit length near the surface.
inline SurfaceError surface_error(const Mesh<3>& mesh, const Level& distance) {
  Execution execution(2);
  double squares = 0, angles = 0, area = 0;
  std::int64_t count = 0;
  for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, execution))
    for (std::int64_t i = 0; i < block.size(); ++i) {
      const auto p = [&](int k) { return mesh.points[block.vertices[3 * i + k]]; };
      for (int k = 0; k < 3; ++k) squares += distance(p(k)) * distance(p(k)), ++count;
      const Vec<3> middle = (1.0 / 3) * (p(0) + p(1) + p(2)), normal = cross(p(1) - p(0), p(2) - p(0));
      Vec<3> gradient{};
      for (int d = 0; d < 3; ++d) {
        Vec<3> up = middle, down = middle;
        up[d] += 0.01;
        down[d] -= 0.01;
        gradient[d] = distance(up) - distance(down);
      }
      const double cosine = std::abs(dot(normal, gradient)) / (norm(normal) * norm(gradient));
      const double angle = std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
      angles += norm(normal) * angle * angle;
      area += norm(normal);
    }
  return {std::sqrt(squares / static_cast<double>(count)), std::sqrt(angles / area)};
}

}  // namespace treemarch::testing
