#include "treemarch/sizing/default_sizes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"

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
  std::array<std::int64_t, Dim> stride{};
  for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) stride[d] = n;
  const UniformBlocks<Dim> uniform(image, execution);
  constexpr std::int64_t kParts = 64;  // few: each has a table
  return image.voxels.visit([&](const auto* voxels) {
    const auto measure_blocks = [&](std::int64_t begin, std::int64_t end) {
      Extent<Dim> part = none;
      for (std::int64_t b = begin; b < end; ++b) {
        const VoxelBox<Dim> box = voxels_of_block(coord_of(b, uniform.extent()), image.extent);
        if (const MaterialId m = uniform.within(box.begin, box.end); m != UniformBlocks<Dim>::kMixed) {
          part.voxels[m] += box.size();
          continue;
        }
        for_each_row(box, image.extent, [&](Coord<Dim> c, std::int64_t i) {
          for (; c[0] < box.end[0]; ++c[0], ++i) {
            ++part.voxels[voxels[i]];
            for (int d = 0; d < Dim; ++d) {
              if (c[d] + 1 == image.extent[d] || voxels[i + stride[d]] == voxels[i]) continue;
              ++part.faces[voxels[i]][d];
              ++part.faces[voxels[i + stride[d]]][d];
            }
          }
        });
      }
      return part;
    };
    return parallel_reduce(execution, uniform.size(), std::max<std::int64_t>(1, block_count(uniform.size(), kParts)),
                           none, measure_blocks, [](Extent<Dim> a, const Extent<Dim>& b) {
                             a.add(b);
                             return a;
                           });
  });
}

/// Sizes of materials, as the thickness of cells and of materials are compared.
template <int Dim>
struct Shapes {
  std::vector<double> thickness;  ///< twice the volume over the area
  double area = 0;                ///< of all interfaces
};

template <int Dim>
Shapes<Dim> shapes_of(const LabelImage<Dim>& image, const Execution& execution) {
  const Extent<Dim> extent = measure(image, execution);
  const Vec<Dim>& spacing = image.frame.spacing;
  const double volume = image.voxel_volume();
  Shapes<Dim> shapes;
  for (std::size_t m = 0; m < extent.voxels.size(); ++m) {
    double area = 0;
    for (int d = 0; d < Dim; ++d) area += static_cast<double>(extent.faces[m][d]) * volume / spacing[d];
    shapes.area += area / 2;
    shapes.thickness.push_back(2 * static_cast<double>(extent.voxels[m]) * volume / area);
  }
  return shapes;
}

/// \param least materials whose thickness is below thin_part of the floor get halves of it, down to this.
template <int Dim>
SizingRule sizes_for(const Shapes<Dim>& shapes, double tolerance, double floor, double least, double thin_part,
                     double largest) {
  constexpr double kThicknessPart = 2;
  constexpr double kCoarsening = 16;
  SizingRule rule;
  rule.tolerance = tolerance;
  rule.floor_size = floor;
  rule.max_size = largest > 0 ? largest : kCoarsening * floor;
  // All sizes are levels of one tree.
  rule.min_size = floor;
  while (2 * rule.min_size <= rule.max_size * kSizeTolerance) rule.min_size *= 2;
  for (const double thickness : shapes.thickness) {
    double size = rule.min_size;
    while (size > floor * kSizeTolerance && size > kThicknessPart * thickness) size /= 2;
    while (size <= floor * kSizeTolerance && size > thin_part * thickness && size / 2 * kSizeTolerance >= least)
      size /= 2;
    rule.material_interface_size.push_back(size);
  }
  return rule;
}

}  // namespace

template <int Dim>
SizingRule driven_sizes(const LabelImage<Dim>& image, double tolerance, double floor, double largest,
                        const Execution& execution) {
  return sizes_for(shapes_of(image, execution), tolerance, floor, floor, 1, largest);
}

template <int Dim>
SizingRule default_sizes(const LabelImage<Dim>& image, Detail detail, const SizeLimits& limits,
                         const Execution& execution) {
  // Simplices that the lattice and its cut make for interfaces of unit area and cells of unit side, measured
  // (docs/stages/sizing.md).
  constexpr double kSimplicesPerArea = Dim == 2 ? 10 : 27;
  constexpr double kSimplices[] = {5e5, 2e6, 8e6}, kTolerance[] = {1, 0.5, 0.25}, kThinPart[] = {2, 0.9, 0.9};
  const double simplices = kSimplices[static_cast<int>(detail)] * (Dim == 2 ? 0.1 : 1);
  const Shapes<Dim> shapes = shapes_of(image, execution);
  const double voxel = *std::ranges::min_element(image.frame.spacing);
  const double least = limits.least > 0 ? limits.least : voxel;
  double floor = std::max(least, std::pow(kSimplicesPerArea * shapes.area / simplices, 1.0 / (Dim - 1)));
  if (limits.least > 0) floor = std::ldexp(least, static_cast<int>(std::lround(std::log2(floor / least))));
  if (limits.largest > 0) floor = std::min(floor, limits.largest);
  const auto choice = static_cast<std::size_t>(detail);
  return sizes_for(shapes, kTolerance[choice] * voxel, floor, std::min(least, floor), kThinPart[choice],
                   limits.largest);
}

template SizingRule driven_sizes(const LabelImage<2>&, double, double, double, const Execution&);
template SizingRule driven_sizes(const LabelImage<3>&, double, double, double, const Execution&);
template SizingRule driven_sizes(const LabelImage<4>&, double, double, double, const Execution&);
template SizingRule default_sizes(const LabelImage<2>&, Detail, const SizeLimits&, const Execution&);
template SizingRule default_sizes(const LabelImage<3>&, Detail, const SizeLimits&, const Execution&);

}  // namespace treemarch
