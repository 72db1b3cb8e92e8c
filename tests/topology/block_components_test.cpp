#include "treemarch/topology/block_components.h"

#include <gtest/gtest.h>

#include <set>

#include "support/images.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {
namespace {

template <int Dim>
void expect_all_found(const LabelImage<Dim>& image) {
  const ComponentMap map = map_components(image, Execution(1));
  std::vector<std::uint8_t> wanted;
  for (std::size_t c = 0; c < map.components.size(); ++c) wanted.push_back(c % 3 != 0);
  std::vector<std::set<std::uint32_t>> expected;
  for (const int threads : {1, 3}) {
    const BlockComponents<Dim> found(image, map, wanted, Execution(threads));
    expected.assign(static_cast<std::size_t>(product(found.extent())), {});
    for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
      const Coord<Dim> block = UniformBlocks<Dim>::block_of(coord_of(v, image.extent));
      if (const std::uint32_t c = map.of(v); wanted[c] != 0)
        expected[static_cast<std::size_t>(linear_index(block, found.extent()))].insert(c);
    }
    for (std::size_t b = 0; b < expected.size(); ++b) {
      const auto here = found[static_cast<std::int64_t>(b)];
      EXPECT_EQ(std::vector(here.begin(), here.end()), std::vector(expected[b].begin(), expected[b].end()));
    }
  }
}

TEST(BlockComponents, AreThoseOfTheirVoxels) {
  expect_all_found(testing::noise_image<2>({37, 50}, 3, 1));
  expect_all_found(testing::noise_image<3>({17, 9, 20}, 4, 2));
  expect_all_found(testing::ball_image<3>({24, 24, 24}, 0.4));
  expect_all_found(testing::ball_image<2>({8, 1}, 0.4));
}

}  // namespace
}  // namespace treemarch
