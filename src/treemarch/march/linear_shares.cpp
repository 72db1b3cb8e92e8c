#include "treemarch/march/linear_shares.h"

#include <algorithm>
#include <cmath>

namespace treemarch {
namespace {

template <int Dim>
double share_at(const LabelImage<Dim>& image, MaterialId material, const Vec<Dim>& point) {
  Coord<Dim> base{};
  Vec<Dim> fraction{};
  for (int d = 0; d < Dim; ++d) {
    const double last = image.extent[d] - 1;
    const double u = std::clamp(point[d] / image.frame.spacing[d] - 0.5, 0.0, last);
    // The last cell is taken with fraction 1, so that base + 1 is a voxel wherever there are two.
    const double cell = std::min(std::floor(u), std::max(0.0, last - 1));
    base[d] = static_cast<std::int32_t>(cell);
    fraction[d] = u - cell;
  }
  double share = 0;
  for (int corner = 0; corner < (1 << Dim); ++corner) {
    double weight = 1;
    Coord<Dim> voxel = base;
    for (int d = 0; d < Dim; ++d) {
      const int high = corner >> d & 1;
      voxel[d] += high;
      weight *= high ? fraction[d] : 1 - fraction[d];
    }
    if (weight > 0 && image.material(voxel) == material) share += weight;
  }
  return share;
}

}  // namespace

template <int Dim>
MaterialField<Dim> linear_shares(const LabelImage<Dim>& image) {
  return [&image](MaterialId material, std::span<const Vec<Dim>> points, std::span<double> values) {
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = share_at(image, material, points[i]);
  };
}

template MaterialField<4> linear_shares<4>(const LabelImage<4>&);

}  // namespace treemarch
