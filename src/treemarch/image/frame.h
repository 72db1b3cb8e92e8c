/// \file
/// Where an image lies in the world.
#pragma once

#include <string>

#include "treemarch/core/vec.h"

namespace treemarch {

/// The affine map from voxels to the world, in millimetres.
///
/// Index space: voxel (i, j, k) is the cell [i, i+1] x [j, j+1] x [k, k+1], its centre at i + 1/2. Inner frame: index
/// space times the spacing; all stages work there, so that lengths and angles are real. World of an inner point x:
///     world = origin + direction * (x - spacing / 2)
/// The columns of `direction` have unit length, up to single precision where the file has no more; they are orthogonal
/// unless the affine is sheared.
template <int Dim>
struct Frame {
  Vec<Dim> spacing = filled(1.0);                    ///< physical sides of a voxel, > 0
  std::array<Vec<Dim>, Dim> direction = identity();  ///< direction[c] is the world direction of axis c (a column)
  Vec<Dim> origin{};                                 ///< world position of the centre of voxel 0
  /// Anatomical meaning of the world axes as in NIfTI and NRRD: one letter an axis that names where the axis points to
  /// ("RAS", "LPS", "LAS", ...); empty where the file declares none.
  std::string space;
  bool has_spacing = true;  ///< false where the format carries none and 1 was assumed

  static constexpr Vec<Dim> filled(double v) {
    Vec<Dim> a{};
    for (double& x : a) x = v;
    return a;
  }
  static constexpr std::array<Vec<Dim>, Dim> identity() {
    std::array<Vec<Dim>, Dim> m{};
    for (int d = 0; d < Dim; ++d) m[d][d] = 1;
    return m;
  }
};

/// World position of a point of the inner frame.
template <int Dim>
constexpr Vec<Dim> to_world(const Frame<Dim>& frame, const Vec<Dim>& x) {
  Vec<Dim> w = frame.origin;
  for (int c = 0; c < Dim; ++c) {
    const double s = x[c] - 0.5 * frame.spacing[c];
    for (int r = 0; r < Dim; ++r) w[r] += frame.direction[c][r] * s;
  }
  return w;
}

}  // namespace treemarch
