/// \file
/// The voxels whose centres lie in a simplex.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "treemarch/image/label_image.h"
#include "treemarch/topology/simplices.h"

namespace treemarch {

/// Visits voxel centres in simplices of the inner frame of an image.
template <int Dim>
class VoxelCentres {
 public:
  /// \pre `image` outlives the object
  explicit VoxelCentres(const LabelImage<Dim>& image) : image_(image) {
    for (int d = 0; d < Dim; ++d) voxels_per_length_[d] = 1 / image.frame.spacing[d];
  }

  /// Calls use(position of the voxel) for every voxel whose centre the simplex contains, its border included; only
  /// those for which wanted(position) is true are tested. Degenerate simplices contain none.
  template <class Wanted, class Use>
  void visit(const Simplex<Dim>& simplex, Wanted&& wanted, Use&& use) const {
    std::array<Span, Dim> spans;
    for (int d = 0; d < Dim; ++d) {
      spans[d] = centres_between(simplex, d);
      if (spans[d].begin >= spans[d].end) return;
    }
    const Barycentric<Dim> barycentric(simplex);
    if (!barycentric.is_valid()) return;
    Coord<Dim> voxel;
    for (int d = 0; d < Dim; ++d) voxel[d] = spans[d].begin;
    while (true) {
      const std::int64_t v = linear_index(voxel, image_.extent);
      if (wanted(v) && barycentric.contains(image_.centre(voxel), kTolerance)) use(v);
      int d = 0;
      while (d < Dim && ++voxel[d] == spans[d].end) {
        voxel[d] = spans[d].begin;
        ++d;
      }
      if (d == Dim) return;
    }
  }

 private:
  static constexpr double kTolerance = 1e-9;  // of barycentric coordinates

  /// Voxels whose centres lie between two planes across one axis: first and one past the last, within the image.
  struct Span {
    std::int32_t begin, end;
  };

  [[nodiscard]] Span centres_between(const Simplex<Dim>& simplex, int axis) const {
    constexpr double kSlack = 1e-9;
    double lo = simplex[0][axis], hi = lo;
    for (const Vec<Dim>& p : simplex) {
      lo = std::min(lo, p[axis]);
      hi = std::max(hi, p[axis]);
    }
    const double extent = image_.extent[axis];
    const double begin = std::ceil(lo * voxels_per_length_[axis] - 0.5 - kSlack);
    const double end = std::floor(hi * voxels_per_length_[axis] - 0.5 + kSlack) + 1;
    return {static_cast<std::int32_t>(std::clamp(begin, 0.0, extent)),
            static_cast<std::int32_t>(std::clamp(end, 0.0, extent))};
  }

  const LabelImage<Dim>& image_;
  Vec<Dim> voxels_per_length_{};
};

}  // namespace treemarch
