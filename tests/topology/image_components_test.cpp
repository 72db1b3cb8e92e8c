#include "treemarch/topology/image_components.h"

#include <gtest/gtest.h>

#include <numeric>

#include "support/images.h"

namespace treemarch {
namespace {

/// Flood fill, voxel by voxel.
template <int Dim>
std::vector<ImageComponent> brute_force(const LabelImage<Dim>& image) {
  const std::int64_t n = product(image.extent);
  std::vector<char> seen(static_cast<std::size_t>(n));
  std::vector<ImageComponent> components;
  for (std::int64_t i = 0; i < n; ++i) {
    if (seen[static_cast<std::size_t>(i)]) continue;
    components.push_back({image.voxels[i], 0, i});
    std::vector<std::int64_t> stack{i};
    seen[static_cast<std::size_t>(i)] = 1;
    while (!stack.empty()) {
      const Coord<Dim> c = coord_of(stack.back(), image.extent);
      stack.pop_back();
      ++components.back().voxels;
      for (int d = 0; d < Dim; ++d) {
        for (const int step : {-1, 1}) {
          Coord<Dim> next = c;
          next[d] += step;
          if (next[d] < 0 || next[d] >= image.extent[d]) continue;
          const std::int64_t j = linear_index(next, image.extent);
          if (seen[static_cast<std::size_t>(j)] || image.voxels[j] != image.voxels[i]) continue;
          seen[static_cast<std::size_t>(j)] = 1;
          stack.push_back(j);
        }
      }
    }
  }
  return components;
}

template <int Dim>
void expect_as_brute_force(const LabelImage<Dim>& image) {
  const auto found = image_components(image, Execution(3));
  const auto expected = brute_force(image);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].material, expected[i].material);
    EXPECT_EQ(found[i].voxels, expected[i].voxels);
    EXPECT_EQ(found[i].first_voxel, expected[i].first_voxel);
  }
  const ComponentMap map = map_components(image, Execution(3));
  std::vector<std::int64_t> voxels(map.components.size());
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    ASSERT_EQ(map.components[map.of(v)].material, image.voxels[v]);
    ++voxels[map.of(v)];
  }
  for (std::size_t i = 0; i < voxels.size(); ++i) EXPECT_EQ(voxels[i], expected[i].voxels);
}

TEST(Components, AgreeWithAFloodFill) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const int labels = 1 + static_cast<int>(seed % 4);
    expect_as_brute_force(testing::noise_image<1>({40}, labels, seed));
    expect_as_brute_force(testing::noise_image<2>({17, 13}, labels, seed));
    expect_as_brute_force(testing::noise_image<3>({9, 11, 7}, labels, seed));
    expect_as_brute_force(testing::noise_image<4>({5, 4, 6, 3}, labels, seed));
  }
  expect_as_brute_force(testing::noise_image<3>({5, 70, 60}, 2, 1));  // rows enough for several threads
}

}  // namespace
}  // namespace treemarch
