#include "treemarch/pipeline/prepare.h"

#include <gtest/gtest.h>

#include <functional>

#include "support/images.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

std::vector<std::int32_t> values(const LabelImage<2>& image) {
  std::vector<std::int32_t> v;
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) v.push_back(image.labels[image.voxels[i]]);
  return v;
}

LabelImage<2> prepared(const LabelImage<2>& image, const PrepareOptions& options) {
  Execution execution(1);
  return prepare_image(image, options, execution);
}

/// Every voxel has the label that a function of the old one gives, and ids follow first appearance.
void expect_mapped(const PrepareOptions& options, const std::function<std::int32_t(std::int32_t)>& map) {
  const auto image = testing::noise_image<2>({13, 11}, 6, 4);  // labels 0, 7, ... 35
  const auto result = prepared(image, options);
  std::vector<std::int32_t> expected = values(image);
  for (auto& v : expected) v = map(v);
  EXPECT_EQ(values(result), expected);
  EXPECT_EQ(result.labels, make_label_image(image.extent, expected).labels);
}

TEST(Prepare, KeepsAndDrops) {
  expect_mapped({.keep = {"7,14"}}, [](int v) { return v == 7 || v == 14 ? v : 0; });
  expect_mapped({.keep = {"7", "14"}}, [](int v) { return v == 7 || v == 14 ? v : 0; });
  expect_mapped({.drop = {"7-21"}}, [](int v) { return v >= 7 && v <= 21 ? 0 : v; });
  expect_mapped({.keep = {"7-21"}, .drop = {"14"}}, [](int v) { return v == 7 || v == 21 ? v : 0; });
  expect_mapped({.keep = {"7"}, .background = -9}, [](int v) { return v == 7 ? v : -9; });
}

TEST(Prepare, Merges) {
  expect_mapped({.merge = {"7,14=100"}}, [](int v) { return v == 7 || v == 14 ? 100 : v; });
  expect_mapped({.merge = {"7-21=28"}}, [](int v) { return v >= 7 && v <= 28 ? 28 : v; });
  expect_mapped({.keep = {"100"}, .merge = {"7-14=100"}}, [](int v) { return v == 7 || v == 14 ? 100 : 0; });
  expect_mapped({.drop = {"trunk"}, .merge = {"14-21=trunk"}}, [](int v) { return v == 14 || v == 21 ? 0 : v; });
}

TEST(Prepare, MergedMaterialsTakeTheNewName) {
  const auto image = testing::noise_image<2>({9, 9}, 4, 1);
  const auto result = prepared(image, {.merge = {"7,14=trunk"}});
  ASSERT_EQ(result.names.size(), result.labels.size());
  const MaterialId m = material_of(result.labels, 7);
  ASSERT_NE(m, kOutside);
  EXPECT_EQ(result.names[m], "trunk");
}

TEST(Prepare, CutsOutARegionThatStaysInItsPlace) {
  Frame<2> frame;
  frame.spacing = {2, 3};
  frame.direction[0] = {0, -1};
  frame.direction[1] = {1, 0};
  frame.origin = {10, 20};
  const auto image = testing::noise_image<2>({13, 11}, 6, 4, frame);
  const auto result = prepared(image, {.roi = "3:7,2:11"});
  EXPECT_EQ(result.extent, (Coord<2>{4, 9}));
  for (std::int64_t i = 0; i < result.voxels.size(); ++i) {
    const Coord<2> c = coord_of(i, result.extent);
    const Coord<2> old{c[0] + 3, c[1] + 2};
    EXPECT_EQ(result.labels[result.voxels[i]], image.labels[image.material(old)]);
    const Vec<2> here = to_world(result.frame, Vec<2>{2.0 * c[0], 3.0 * c[1]});
    const Vec<2> there = to_world(image.frame, Vec<2>{2.0 * old[0], 3.0 * old[1]});
    EXPECT_NEAR(here[0], there[0], 1e-12);
    EXPECT_NEAR(here[1], there[1], 1e-12);
  }
}

TEST(Prepare, CropsGreyValuesAsLabels) {
  const auto image = testing::noise_image<2>({13, 11}, 6, 4);
  GreyImage<2> grey{image.extent, image.frame, {}};
  for (const std::int32_t v : values(image)) grey.values.push_back(static_cast<float>(v));
  const auto labels = prepared(image, {.roi = "3:7,2:11"});
  const auto part = crop_image(grey, "3:7,2:11");
  EXPECT_EQ(part.extent, labels.extent);
  EXPECT_EQ(part.frame.origin, labels.frame.origin);
  const std::vector<std::int32_t> expected = values(labels);
  EXPECT_EQ(std::vector<std::int32_t>(part.values.begin(), part.values.end()), expected);
  EXPECT_EQ(crop_image(grey, "").values, grey.values);
  EXPECT_THROW(crop_image(grey, "0:14,0:11"), Error);
}

TEST(Prepare, RefusesWhatMakesNoSense) {
  const auto image = testing::noise_image<2>({13, 11}, 6, 4);
  for (const char* roi : {"0:1", "0:14,0:11", "3:3,0:1", "-1:2,0:1", "a:2,0:1", "1:2,1:2,1:2", "5:2,0:1"})
    EXPECT_THROW(prepared(image, {.roi = roi}), Error) << roi;
  EXPECT_THROW(prepared(image, {.keep = {"1"}}), Error);
  EXPECT_THROW(prepared(image, {.merge = {"1=7"}}), Error);
  EXPECT_THROW(prepared(image, {.merge = {"7"}}), Error);
  EXPECT_THROW(prepared(image, {.drop = {"7-35"}}), Error) << "nothing is left";
}

}  // namespace
}  // namespace treemarch
