#include "treemarch/pipeline/sizes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/images.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

SizingRule completed(const LabelImage<3>& image, const MeshOptions& options) {
  return complete_sizes(image, options, Execution(2));
}

TEST(Sizes, WhatIsGivenStays) {
  const auto image = testing::ball_image<3>({24, 24, 24}, 0.3);
  MeshOptions options;
  options.sizes.min_size = 2;
  const SizingRule plain = completed(image, options);
  EXPECT_EQ(plain.min_size, 2);
  EXPECT_EQ(plain.tolerance, 0);
  EXPECT_TRUE(plain.material_interface_size.empty());

  options.sizes.tolerance = 0.3;
  options.sizes.material_size = {0, 4};
  options.sizes.layers = 2;
  const SizingRule driven = completed(image, options);
  EXPECT_EQ(driven.floor_size, 2);
  EXPECT_EQ(driven.tolerance, 0.3);
  EXPECT_GT(driven.min_size, 2);
  EXPECT_EQ(driven.material_size, options.sizes.material_size);
  EXPECT_EQ(driven.layers, 2);
  options.sizes.min_size = 0;
  EXPECT_EQ(completed(image, options).floor_size, 0.9);
  options.sizes.layers = 0;
  EXPECT_EQ(completed(image, options).floor_size, 1);
}

TEST(Sizes, LayersMayHaveSmallCellsHoweverLargeTheOthersAre) {
  const auto image = testing::noise_image<3>({90, 80, 70}, 4, 1);
  MeshOptions options;
  options.detail = Detail::coarse;
  ASSERT_GT(completed(image, options).floor_size, 2);
  options.sizes.layers = 2;
  const SizingRule rule = completed(image, options);
  EXPECT_EQ(rule.layer_floor, 0.9);
  EXPECT_GT(rule.floor_size, 1.8);
  const double level = std::log2(rule.floor_size / rule.layer_floor);
  EXPECT_EQ(level, std::round(level)) << "all sizes are levels of one tree";
}

TEST(Sizes, NothingGivenFollowsTheDetail) {
  const auto image = testing::ball_image<3>({24, 24, 24}, 0.3);
  MeshOptions options;
  EXPECT_EQ(completed(image, options).tolerance, 0.5);
  options.detail = Detail::fine;
  EXPECT_EQ(completed(image, options).tolerance, 0.25);
  options.method = Method::paper;  // its cells are voxels
  EXPECT_EQ(completed(image, options).tolerance, 0);
}

TEST(Sizes, RefusesNumbersOutOfRange) {
  const auto image = testing::ball_image<3>({8, 8, 8}, 0.3);
  const auto expect_refused = [&](const SizingRule& rule, const std::string& option) {
    try {
      check_sizes(image, rule);
      ADD_FAILURE() << option << " was not refused";
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::usage);
      EXPECT_TRUE(std::string(error.what()).starts_with(option)) << error.what();
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused({.min_size = -1}, "--min-size");
  expect_refused({.min_size = 3, .max_size = 2}, "--min-size");
  expect_refused({.tolerance = nan}, "--tolerance");
  expect_refused({.grading = 0}, "--grading");
  expect_refused({.grading = 1.5}, "--grading");
  expect_refused({.layers = -1}, "--layers");
  expect_refused({.material_size = {INFINITY}}, "--size");
  expect_refused({.voxel_size = {1, 2}}, "voxel_size");
}

}  // namespace
}  // namespace treemarch
