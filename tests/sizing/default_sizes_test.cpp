#include "treemarch/sizing/default_sizes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/images.h"

namespace treemarch {
namespace {

const Execution& execution() {
  static const Execution two(2);
  return two;
}

/// A block of 1, a sheet of two voxels of 2, a sheet of one voxel of 3, in 0.
LabelImage<3> layered() {
  std::vector<std::int32_t> values;
  for (int i = 0; i < 40 * 40 * 40; ++i) {
    const int x = i % 40;
    values.push_back(x < 20 ? 1 : x < 22 ? 2 : x == 30 ? 3 : 0);
  }
  return make_label_image<3>({40, 40, 40}, values);
}

void expect_levels_of_one_tree(const SizingRule& rule) {
  for (const double size : rule.material_interface_size) {
    const double level = std::log2(size / rule.floor_size);
    EXPECT_NEAR(level, std::round(level), 1e-9);
    EXPECT_LE(size, rule.max_size * kSizeTolerance);
  }
  EXPECT_LE(rule.floor_size, rule.min_size);
  EXPECT_LE(rule.min_size, rule.max_size * kSizeTolerance);
}

TEST(DefaultSizes, AreLevelsOfOneTree) {
  for (const Detail detail : {Detail::coarse, Detail::normal, Detail::fine}) {
    expect_levels_of_one_tree(default_sizes(layered(), detail, {}, execution()));
    expect_levels_of_one_tree(
        default_sizes(testing::noise_image<3>({20, 30, 40}, 5, 1), detail, {.largest = 3}, execution()));
    expect_levels_of_one_tree(default_sizes(testing::ball_image<2>({200, 300}, 0.4), detail, {}, execution()));
  }
  expect_levels_of_one_tree(driven_sizes(layered(), 0.5, 1.5, 0, execution()));
}

TEST(DefaultSizes, ThinMaterialsHaveSmallCells) {
  const auto image = layered();
  const SizingRule rule = driven_sizes(image, 0.5, 0.5, 0, execution());
  const double thickness[] = {20, 2, 0, 1};  // by material: 1, 2, 0, 3; the rest of the box counts as well
  ASSERT_EQ(image.labels, (std::vector<std::int32_t>{1, 2, 0, 3}));
  for (const std::size_t m : {1U, 3U}) EXPECT_LE(rule.material_interface_size[m], 2 * thickness[m]);
  EXPECT_GT(rule.material_interface_size[0], rule.material_interface_size[3]);
}

TEST(DefaultSizes, MoreDetailMeansSmallerCells) {
  const auto image = testing::noise_image<3>({64, 64, 64}, 3, 2);  // so much area that the number of cells counts
  SizingRule before;
  for (const Detail detail : {Detail::coarse, Detail::normal, Detail::fine}) {
    const SizingRule rule = default_sizes(image, detail, {}, execution());
    if (detail != Detail::coarse) {
      EXPECT_LT(rule.tolerance, before.tolerance);
      EXPECT_LE(rule.floor_size, before.floor_size);
    }
    before = rule;
  }
  EXPECT_GT(default_sizes(image, Detail::coarse, {}, execution()).floor_size, 2);
}

TEST(DefaultSizes, ScaleWithTheImageAndStayBelowTheLargest) {
  auto image = testing::ball_image<3>({40, 40, 40}, 0.4);
  const SizingRule one = default_sizes(image, Detail::normal, {}, execution());
  for (double& s : image.frame.spacing) s *= 8;
  const SizingRule eight = default_sizes(image, Detail::normal, {}, execution());
  EXPECT_DOUBLE_EQ(eight.floor_size, 8 * one.floor_size);
  EXPECT_DOUBLE_EQ(eight.tolerance, 8 * one.tolerance);
  for (std::size_t m = 0; m < 2; ++m)
    EXPECT_DOUBLE_EQ(eight.material_interface_size[m], 8 * one.material_interface_size[m]);
  const SizingRule limited = default_sizes(image, Detail::normal, {.largest = 5}, execution());
  EXPECT_LE(limited.floor_size, 5);
  EXPECT_LE(limited.min_size, 5);
}

}  // namespace
}  // namespace treemarch
