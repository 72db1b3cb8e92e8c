#include "treemarch/report/estimate.h"

#include <array>

namespace treemarch {
namespace {

// Measured on the images of the demo and of the tests (docs/report.md).
constexpr double kCellsPerInterfaceVoxel[] = {0, 0, 6, 30};
constexpr double kBytesPerCell = 300;
constexpr double kBytesPerVoxel = 12;

}  // namespace

template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image) {
  std::array<std::int64_t, Dim> stride{};
  std::int64_t n = 1;
  for (int d = 0; d < Dim; ++d) {
    stride[d] = n;
    n *= image.extent[d];
  }
  MeshEstimate estimate;
  image.voxels.visit([&](const auto* v) {
    Coord<Dim> c{};
    for (std::int64_t i = 0; i < n; ++i) {
      bool differs = false;
      for (int d = 0; d < Dim; ++d) {
        if (c[d] > 0) differs |= v[i] != v[i - stride[d]];
        if (c[d] + 1 < image.extent[d]) differs |= v[i] != v[i + stride[d]];
      }
      estimate.interface_voxels += differs;
      for (int d = 0; d < Dim && ++c[d] == image.extent[d]; ++d) c[d] = 0;
    }
  });
  const double cells = kCellsPerInterfaceVoxel[Dim] * static_cast<double>(estimate.interface_voxels);
  estimate.cells = static_cast<std::int64_t>(cells);
  estimate.memory_bytes = static_cast<std::int64_t>(kBytesPerCell * cells + kBytesPerVoxel * static_cast<double>(n));
  return estimate;
}

template MeshEstimate estimate_mesh(const LabelImage<2>&);
template MeshEstimate estimate_mesh(const LabelImage<3>&);

}  // namespace treemarch
