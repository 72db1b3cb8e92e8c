#include "treemarch/pipeline/material_order.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>

namespace treemarch {

namespace {

template <int Dim>
std::vector<std::int64_t> count_voxels(const LabelImage<Dim>& image) {
  std::vector<std::int64_t> voxels(image.labels.size());
  image.voxels.visit([&](const auto* v) {
    for (std::int64_t i = 0; i < image.voxels.size(); ++i) ++voxels[v[i]];
  });
  return voxels;
}

}  // namespace

template <int Dim>
std::vector<MaterialId> material_order(const LabelImage<Dim>& image, MaterialOrder order,
                                       const std::vector<MaterialId>& first) {
  std::vector<MaterialId> all(image.labels.size());
  std::iota(all.begin(), all.end(), 0U);
  if (order == MaterialOrder::label)
    std::ranges::sort(all, std::less<>(), [&](MaterialId m) { return image.labels[m]; });
  if (order == MaterialOrder::largest || order == MaterialOrder::smallest) {
    const std::vector<std::int64_t> voxels = count_voxels(image);
    std::ranges::stable_sort(all, std::greater<>(), [&](MaterialId m) { return voxels[m]; });
    if (order == MaterialOrder::smallest) std::ranges::reverse(all);
  }
  std::vector<std::uint8_t> named(all.size(), 0);
  for (const MaterialId m : first) named[m] = 1;
  std::erase_if(all, [&](MaterialId m) { return named[m] != 0; });
  all.insert(all.begin(), first.begin(), first.end());
  return all;
}

template std::vector<MaterialId> material_order(const LabelImage<2>&, MaterialOrder, const std::vector<MaterialId>&);
template std::vector<MaterialId> material_order(const LabelImage<3>&, MaterialOrder, const std::vector<MaterialId>&);
template std::vector<MaterialId> material_order(const LabelImage<4>&, MaterialOrder, const std::vector<MaterialId>&);

}  // namespace treemarch
