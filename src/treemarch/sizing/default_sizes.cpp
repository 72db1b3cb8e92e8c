#include "treemarch/sizing/default_sizes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

/// Voxels of each material and their faces on interfaces, by axis.
template <int Dim>
struct Extent {
  std::vector<std::int64_t> voxels;
  std::vector<std::array<std::int64_t, Dim>> faces;

  void add(const Extent& other) {
    for (std::size_t m = 0; m < voxels.size(); ++m) {
      voxels[m] += other.voxels[m];
      for (int d = 0; d < Dim; ++d) faces[m][d] += other.faces[m][d];
    }
  }
};

template <int Dim>
Extent<Dim> measure(const LabelImage<Dim>& image, const Execution& execution) {
  const std::size_t materials = image.labels.size();
  const Extent<Dim> none{std::vector<std::int64_t>(materials), std::vector<std::array<std::int64_t, Dim>>(materials)};
  const std::int64_t row = image.extent[0], rows = image.voxels.size() / row;
  const std::int64_t block = std::max<std::int64_t>(1, block_count(rows, 64));  // few blocks: each has a table
  std::array<std::int64_t, Dim> stride{};
  for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) stride[d] = n;
  std::vector<Extent<Dim>> part(block_count(rows, block), none);
  image.voxels.visit([&](const auto* voxels) {
    parallel_for(execution, static_cast<std::int64_t>(part.size()), 1, [&](std::int64_t b) {
      for (std::int64_t r = b * block; r < std::min(rows, (b + 1) * block); ++r) {
        Coord<Dim> c = coord_of(r * row, image.extent);
        for (std::int64_t i = r * row; i < (r + 1) * row; ++i, ++c[0]) {
          ++part[b].voxels[voxels[i]];
          for (int d = 0; d < Dim; ++d) {
            if (c[d] + 1 == image.extent[d] || voxels[i + stride[d]] == voxels[i]) continue;
            ++part[b].faces[voxels[i]][d];
            ++part[b].faces[voxels[i + stride[d]]][d];
          }
        }
      }
    });
  });
  Extent<Dim> sum = none;
  for (const auto& p : part) sum.add(p);
  return sum;
}

}  // namespace

template <int Dim>
SizingRule default_sizes(const LabelImage<Dim>& image, double largest, const Execution& execution) {
  // Simplices that the lattice and its cut make for interfaces of unit area and cells of unit side, measured
  // (docs/stages/sizing.md).
  constexpr double kSimplicesPerArea = Dim == 2 ? 10 : 27;
  constexpr double kThicknessPart = 0.9, kSmallest = 0.75;
  constexpr double kSimplices = Dim == 2 ? 2e5 : 2e6;
  const Extent<Dim> extent = measure(image, execution);
  const Vec<Dim>& spacing = image.frame.spacing;
  const double voxel = *std::min_element(spacing.begin(), spacing.end());
  double volume = 1;
  for (const double s : spacing) volume *= s;

  std::vector<double> area(extent.voxels.size(), 0);
  double all = 0;
  for (std::size_t m = 0; m < area.size(); ++m) {
    for (int d = 0; d < Dim; ++d) area[m] += static_cast<double>(extent.faces[m][d]) * volume / spacing[d];
    all += area[m] / 2;
  }
  SizingRule rule;
  rule.min_size = std::max(voxel, std::pow(kSimplicesPerArea * all / kSimplices, 1.0 / (Dim - 1)));
  if (largest > 0) rule.min_size = std::min(rule.min_size, largest);
  // Thin materials take halves of the common size, so that all sizes are levels of one tree.
  rule.material_interface_size.assign(area.size(), 0);
  for (std::size_t m = 0; m < area.size(); ++m) {
    const double thickness = 2 * static_cast<double>(extent.voxels[m]) * volume / area[m];
    double size = rule.min_size;
    while (size > kThicknessPart * thickness && size / 2 >= kSmallest * voxel) size /= 2;
    rule.material_interface_size[m] = size;
  }
  return rule;
}

template SizingRule default_sizes(const LabelImage<2>&, double, const Execution&);
template SizingRule default_sizes(const LabelImage<3>&, double, const Execution&);

}  // namespace treemarch
