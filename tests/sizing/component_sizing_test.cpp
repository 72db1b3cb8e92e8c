#include "treemarch/sizing/component_sizing.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/shapes.h"
#include "treemarch/sizing/sizing_rule.h"
#include "treemarch/topology/image_components.h"

namespace treemarch {
namespace {

/// A block of label 1 and, apart from it, a box of label 1 of the given extent, in 0.
LabelImage<3> with_island(const Coord<3>& island, double spacing = 1) {
  const Coord<3> extent{48, 40, 40};
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)), 0);
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    bool inside = c[0] >= 24;
    if (c[0] < 22) inside = true;
    for (int d = 0; d < 3 && c[0] < 22; ++d) inside = inside && c[d] >= 2 && c[d] < 2 + island[d];
    values[static_cast<std::size_t>(i)] = inside;
  }
  Frame<3> frame;
  frame.spacing = {spacing, spacing, spacing};
  return make_label_image(extent, values, frame);
}

/// One a voxel, 0 where none is asked for.
std::vector<float> sizes_of(const LabelImage<3>& image, const ComponentSizing& sizing) {
  std::vector<float> sizes(static_cast<std::size_t>(image.voxels.size()), 0);
  for (const auto& [voxel, size] : component_sizes(image, sizing, Execution(2))) {
    float& own = sizes[static_cast<std::size_t>(voxel)];
    EXPECT_EQ(own, 0) << "asked twice";
    own = size;
  }
  return sizes;
}

float island_size(const LabelImage<3>& image, const ComponentSizing& sizing) {
  const std::vector<float> sizes = sizes_of(image, sizing);
  const float size = sizes[static_cast<std::size_t>(linear_index<3>({2, 2, 2}, image.extent))];
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    const bool island = image.labels[image.voxels[v]] == 1 && coord_of(v, image.extent)[0] < 22;
    EXPECT_EQ(sizes[static_cast<std::size_t>(v)], island ? size : 0);
  }
  return size;
}

TEST(ComponentSizes, IslandsGetCellsOfTheirOwnSize) {
  const ComponentSizing sizing{.floor = 8, .least = 1};
  EXPECT_EQ(island_size(with_island({2, 2, 2}), sizing), 2);
  EXPECT_EQ(island_size(with_island({4, 4, 4}), sizing), 4);
  EXPECT_EQ(island_size(with_island({8, 8, 8}), sizing), 0);
  EXPECT_EQ(island_size(with_island({1, 1, 16}), sizing), 1);
  EXPECT_EQ(island_size(with_island({2, 2, 16}), sizing), 2);
  EXPECT_EQ(island_size(with_island({1, 1, 7}), sizing), 0) << "below --min-component";
  EXPECT_EQ(island_size(with_island({2, 2, 2}, 3), {.floor = 24, .least = 3}), 6);
  EXPECT_EQ(island_size(with_island({2, 2, 2}), {.floor = 8, .least = 4}), 4);
}

TEST(ComponentSizes, HoldForEveryComponentOfRandomImages) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    const auto image = testing::ShapePainter<3>({24, 20, 16}, 4, seed)
                           .paint(static_cast<testing::Shapes>(seed % testing::kShapeKinds));
    const ComponentSizing sizing{.min_component = 4, .left_out = 0, .floor = 6, .least = 0.75};
    const std::vector<float> sizes = sizes_of(image, sizing);
    const ComponentMap map = map_components(image, Execution(2));
    for (std::size_t v = 0; v < sizes.size(); ++v) {
      const ImageComponent& c = map.components[map.of(static_cast<std::int64_t>(v))];
      const double size = sizes[v];
      EXPECT_EQ(sizes[v], sizes[static_cast<std::size_t>(c.first_voxel)]);
      if (size > 0) {
        EXPECT_TRUE(size == 3 || size == 1.5 || size == 0.75) << size;
        EXPECT_NE(c.material, sizing.left_out);
      } else if (c.material != sizing.left_out && c.voxels >= sizing.min_component) {
        EXPECT_GE(std::cbrt(c.voxels), sizing.floor / kSizeTolerance);
      }
    }
  }
}

}  // namespace
}  // namespace treemarch
