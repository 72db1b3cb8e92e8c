/// \file
/// Images of shapes whose surface is known, for the tests of fields.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// The same number of voxels for the first axes of either dimension.
template <int Dim>
Coord<Dim> box(std::array<std::int32_t, 3> sides) {
  Coord<Dim> c{};
  for (int d = 0; d < Dim; ++d) c[d] = sides[d];
  return c;
}

template <int Dim>
Vec<Dim> centre_of(const Coord<Dim>& voxel) {
  Vec<Dim> x{};
  for (int d = 0; d < Dim; ++d) x[d] = voxel[d] + 0.5;
  return x;
}

/// Labels given by a function of the voxel.
template <int Dim>
LabelImage<Dim> image_of(const Coord<Dim>& extent, const std::function<std::int32_t(const Coord<Dim>&)>& label) {
  std::vector<std::int32_t> voxels(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) voxels[i] = label(coord_of(i, extent));
  return make_label_image(extent, voxels);
}

/// Random labels in patches of `patch` voxels a side; patch 1 is noise.
template <int Dim>
LabelImage<Dim> random_labels(const Coord<Dim>& extent, int labels, int patch, unsigned seed) {
  std::mt19937 random(seed);
  Coord<Dim> coarse = extent;
  for (auto& e : coarse) e = (e + patch - 1) / patch;
  std::vector<std::int32_t> value(static_cast<std::size_t>(product(coarse)));
  for (auto& v : value) v = static_cast<std::int32_t>(random() % labels);
  return image_of<Dim>(extent, [&](Coord<Dim> c) {
    for (auto& v : c) v /= patch;
    return value[linear_index(c, coarse)];
  });
}

/// Points in and around an image: a third at multiples of 1/4 voxel, where lattice vertices are; some beyond the box.
template <int Dim>
std::vector<Vec<Dim>> random_points(const LabelImage<Dim>& image, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Vec<Dim>> points(count);
  for (int i = 0; i < count; ++i)
    for (int d = 0; d < Dim; ++d) {
      const double u = (random() % 10000) * 1e-4 * (image.extent[d] + 2) - 1;
      points[i][d] = (i % 3 == 0 ? std::round(4 * u) / 4 : u) * image.frame.spacing[d];
    }
  return points;
}

}  // namespace treemarch
