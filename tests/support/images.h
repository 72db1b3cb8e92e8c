/// \file
/// Images for tests.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch::testing {

/// Every voxel takes one of `labels` values 0, 7, 14, ... at random.
template <int Dim>
LabelImage<Dim> noise_image(const Coord<Dim>& extent, int labels, unsigned seed, const Frame<Dim>& frame = {}) {
  std::mt19937 random(seed);
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (auto& v : values) v = static_cast<std::int32_t>(random() % static_cast<unsigned>(labels)) * 7;
  return make_label_image(extent, values, frame);
}

/// A ball of label `inside` in the middle of a box of zeros, its radius a fraction of the smallest side.
template <int Dim>
LabelImage<Dim> ball_image(const Coord<Dim>& extent, double radius, std::int32_t inside = 1,
                           const Frame<Dim>& frame = {}) {
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<Dim> c = coord_of(i, extent);
    double r2 = 0, smallest = extent[0] * frame.spacing[0];
    for (int d = 0; d < Dim; ++d) {
      const double x = (c[d] + 0.5 - 0.5 * extent[d]) * frame.spacing[d];
      r2 += x * x;
      smallest = std::min(smallest, extent[d] * frame.spacing[d]);
    }
    values[static_cast<std::size_t>(i)] = r2 < radius * radius * smallest * smallest ? inside : 0;
  }
  return make_label_image(extent, values, frame);
}

}  // namespace treemarch::testing
