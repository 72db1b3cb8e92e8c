#include "treemarch/report/estimate.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace treemarch {
namespace {

// Fitted to runs over six images of 0.07 to 7 million voxels, of which none is off by more than a third.
constexpr double kCellsPerArea[] = {0, 0, 20, 38};  // of interfaces, in units of the smallest cell
constexpr double kBytesPerCell = 65;
constexpr double kBytesPerVoxel = 12;
constexpr double kBytesAlways = 50e6;

}  // namespace

template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image) {
  std::array<std::int64_t, Dim> stride{}, faces{};
  std::int64_t n = 1;
  double voxel = 1;
  for (int d = 0; d < Dim; ++d) {
    stride[d] = n;
    n *= image.extent[d];
    voxel *= image.frame.spacing[d];
  }
  image.voxels.visit([&](const auto* v) {
    Coord<Dim> c{};
    for (std::int64_t i = 0; i < n; ++i) {
      for (int d = 0; d < Dim; ++d) faces[d] += c[d] > 0 && v[i] != v[i - stride[d]];
      for (int d = 0; d < Dim && ++c[d] == image.extent[d]; ++d) c[d] = 0;
    }
  });
  MeshEstimate estimate;
  for (int d = 0; d < Dim; ++d)
    estimate.interface_area += static_cast<double>(faces[d]) * voxel / image.frame.spacing[d];
  const double smallest = *std::ranges::min_element(image.frame.spacing);
  const double cells = kCellsPerArea[Dim] * estimate.interface_area / std::pow(smallest, Dim - 1);
  estimate.cells = static_cast<std::int64_t>(cells);
  estimate.memory_bytes =
      static_cast<std::int64_t>(kBytesAlways + kBytesPerCell * cells + kBytesPerVoxel * static_cast<double>(n));
  return estimate;
}

template MeshEstimate estimate_mesh(const LabelImage<2>&);
template MeshEstimate estimate_mesh(const LabelImage<3>&);

}  // namespace treemarch
