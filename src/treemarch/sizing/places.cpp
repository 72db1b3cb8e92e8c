#include "treemarch/sizing/places.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace treemarch {
namespace {

/// Lowers the size of each voxel to size_at(world position of its centre), where that is above 0.
template <int Dim, class SizeAt>
std::int64_t lower_sizes(const LabelImage<Dim>& image, std::vector<float>& sizes, SizeAt&& size_at) {
  sizes.resize(static_cast<std::size_t>(image.voxels.size()), 0);
  std::int64_t asked = 0;
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    const auto size = static_cast<float>(size_at(to_world(image.frame, image.centre(coord_of(i, image.extent)))));
    if (!(size > 0) || !std::isfinite(size)) continue;
    ++asked;
    float& at = sizes[static_cast<std::size_t>(i)];
    at = at > 0 ? std::min(at, size) : size;
  }
  return asked;
}

/// Solves a small linear system with the given columns, with pivots.
template <int Dim>
Vec<Dim> solve(std::array<Vec<Dim>, Dim> column, Vec<Dim> b) {
  for (int i = 0; i < Dim; ++i) {
    int pivot = i;
    for (int r = i + 1; r < Dim; ++r)
      if (std::abs(column[i][r]) > std::abs(column[i][pivot])) pivot = r;
    for (int c = 0; c < Dim; ++c) std::swap(column[c][i], column[c][pivot]);
    std::swap(b[i], b[pivot]);
    for (int r = i + 1; r < Dim; ++r) {
      const double q = column[i][r] / column[i][i];
      for (int c = i; c < Dim; ++c) column[c][r] -= q * column[c][i];
      b[r] -= q * b[i];
    }
  }
  for (int i = Dim; i-- > 0;) {
    for (int c = i + 1; c < Dim; ++c) b[i] -= column[c][i] * b[c];
    b[i] /= column[i][i];
  }
  return b;
}

}  // namespace

template <int Dim>
std::int64_t add_place(const LabelImage<Dim>& image, const SizedPlace<Dim>& place, std::vector<float>& sizes) {
  return lower_sizes(image, sizes, [&](const Vec<Dim>& x) {
    bool inside = place.is_ball ? squared_norm(x - place.low) <= place.radius * place.radius : true;
    for (int d = 0; d < Dim && !place.is_ball; ++d) inside = inside && x[d] >= place.low[d] && x[d] <= place.high[d];
    return inside ? place.size : 0;
  });
}

template <int Dim>
std::int64_t add_size_image(const LabelImage<Dim>& image, const GreyImage<Dim>& values, std::vector<float>& sizes) {
  std::array<Vec<Dim>, Dim> column = values.frame.direction;
  for (int d = 0; d < Dim; ++d) column[d] = values.frame.spacing[d] * column[d];
  return lower_sizes(image, sizes, [&](const Vec<Dim>& x) {
    constexpr double kSlack = 1e-4;  // voxels: positions come from affines of single precision
    const Vec<Dim> at = solve<Dim>(column, x - values.frame.origin);
    Coord<Dim> voxel{};
    for (int d = 0; d < Dim; ++d) {
      if (at[d] < -0.5 - kSlack || at[d] > values.extent[d] - 0.5 + kSlack) return 0.0F;
      voxel[d] = std::clamp(static_cast<std::int32_t>(std::lround(at[d])), 0, values.extent[d] - 1);
    }
    return values.values[static_cast<std::size_t>(linear_index(voxel, values.extent))];
  });
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                      \
  template std::int64_t add_place(const LabelImage<DIM>&, const SizedPlace<DIM>&, std::vector<float>&); \
  template std::int64_t add_size_image(const LabelImage<DIM>&, const GreyImage<DIM>&, std::vector<float>&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
