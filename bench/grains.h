/// \file
/// An image for benchmarks.
#pragma once

#include <random>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// 216 touching grains in a background, about a fifth of a cube of `side` voxels.
inline LabelImage<3> grains(int side) {
  std::mt19937 random(1);
  std::vector<Vec<3>> seed(216);
  const double low = 0.2 * side;
  for (Vec<3>& s : seed)
    for (double& u : s) u = low + (random() % 1000) * 1e-3 * (side - 2 * low);
  std::vector<std::int32_t> voxels;
  const Coord<3> extent{side, side, side};
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    const Vec<3> x{c[0] + 0.5, c[1] + 0.5, c[2] + 0.5};
    std::size_t best = 0;
    for (std::size_t s = 1; s < seed.size(); ++s)
      if (squared_norm(x - seed[s]) < squared_norm(x - seed[best])) best = s;
    const bool inside = norm(x - Vec<3>{side / 2.0, side / 2.0, side / 2.0}) < 0.36 * side;
    voxels.push_back(inside ? static_cast<std::int32_t>(best) + 1 : 0);
  }
  return make_label_image(extent, voxels);
}

}  // namespace treemarch
