#include "treemarch/pipeline/between_moments.h"

#include <algorithm>
#include <cstdint>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 1 << 14;

/// Between which moments a voxel of the new image lies; the same one twice before the first and after the last.
struct Pair {
  std::int64_t earlier, later;
};

Pair moments_of(std::int64_t k, std::int64_t moments) {
  return {std::max<std::int64_t>(k - 1, 0), std::min(k, moments - 1)};
}

/// What a rule asks for where two materials meet.
double interface_size(const SizingRule& rule, double smallest, MaterialId a, MaterialId b) {
  for (const SizingRule::Interface& i : rule.interface_size)
    if (std::minmax(i.first, i.second) == std::minmax(a, b)) return i.size;
  double size = rule.min_size > 0 ? rule.min_size : smallest;
  for (const MaterialId m : {a, b})
    if (m < rule.material_interface_size.size() && rule.material_interface_size[m] > 0)
      size = std::min(size, rule.material_interface_size[m]);
  return size;
}

template <int Dim>
std::int64_t voxels_per_moment(const LabelImage<Dim>& image) {
  return image.voxels.size() / image.extent[Dim - 1];
}

}  // namespace

template <int Dim>
LabelImage<Dim> between_moments(const LabelImage<Dim>& image, const Execution& execution) {
  LabelImage<Dim> result;
  result.extent = image.extent;
  const std::int64_t moments = result.extent[Dim - 1]++;
  result.frame = image.frame;
  result.labels = image.labels;
  result.names = image.names;
  result.voxels = CompactArray(product(result.extent), image.labels.size());
  const std::int64_t row = voxels_per_moment(image);
  parallel_for(execution, result.voxels.size(), kGrain, [&](std::int64_t i) {
    result.voxels.set(i, image.voxels[moments_of(i / row, moments).later * row + i % row]);
  });
  return result;
}

template <int Dim>
SizingRule sizes_between_moments(const LabelImage<Dim>& image, const SizingRule& rule, const Execution& execution) {
  SizingRule result = rule;
  const std::int64_t moments = image.extent[Dim - 1], row = voxels_per_moment(image);
  result.voxel_size.assign(static_cast<std::size_t>((moments + 1) * row), 0);
  const double smallest = *std::ranges::min_element(image.frame.spacing);
  parallel_for(execution, (moments + 1) * row, kGrain, [&](std::int64_t i) {
    const auto [earlier, later] = moments_of(i / row, moments);
    float& size = result.voxel_size[static_cast<std::size_t>(i)];
    const auto lower = [&](double s) { size = static_cast<float>(size > 0 ? std::min<double>(size, s) : s); };
    if (!rule.voxel_size.empty())
      for (const std::int64_t t : {earlier, later})
        if (const float s = rule.voxel_size[static_cast<std::size_t>(t * row + i % row)]; s > 0) lower(s);
    const std::int64_t at = earlier * row + i % row;
    const Coord<Dim> c = coord_of(at, image.extent);
    const MaterialId own = image.voxels[at];
    for (std::int64_t d = 0, stride = 1; d + 1 < Dim; stride *= image.extent[static_cast<std::size_t>(d++)])
      for (const int side : {-1, 1}) {
        const std::int32_t beside = c[static_cast<std::size_t>(d)] + side;
        if (beside < 0 || beside >= image.extent[static_cast<std::size_t>(d)]) continue;
        if (const MaterialId other = image.voxels[at + side * stride]; other != own)
          lower(interface_size(rule, smallest, own, other));
      }
  });
  return result;
}

template <int Dim>
void move_to_moments(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const Execution& execution) {
  const double step = image.frame.spacing[Dim - 1], end = image.extent[Dim - 1] * step;
  parallel_for(execution, std::ssize(mesh.points), kGrain, [&](std::int64_t v) {
    double& time = mesh.points[static_cast<std::size_t>(v)][Dim - 1];
    const double there = time - 0.5 * step;
    time = std::max(there, 0.5 * time);                                          // before the first moment
    time = std::min(time, end - 0.5 * std::max(0.0, end + 0.5 * step - there));  // after the last
  });
}

template LabelImage<4> between_moments(const LabelImage<4>&, const Execution&);
template SizingRule sizes_between_moments(const LabelImage<4>&, const SizingRule&, const Execution&);
template void move_to_moments(Mesh<4>&, const LabelImage<4>&, const Execution&);

}  // namespace treemarch
