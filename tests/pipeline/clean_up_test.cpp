#include "treemarch/pipeline/clean_up.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/images.h"
#include "treemarch/topology/image_components.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<std::int32_t> values(const LabelImage<Dim>& image) {
  std::vector<std::int32_t> v;
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) v.push_back(image.labels[image.voxels[i]]);
  return v;
}

template <int Dim>
CleanUpReport clean(LabelImage<Dim>& image, std::int64_t islands, std::int64_t holes) {
  Execution execution(2);
  return clean_up(image, {islands, holes, 0}, execution);
}

TEST(clean_up, does_nothing_unless_asked) {
  auto image = testing::noise_image<3>({8, 9, 7}, 4, 2);
  const auto before = values(image);
  EXPECT_TRUE(clean(image, 0, 0).empty());
  EXPECT_EQ(values(image), before);
}

TEST(clean_up, leaves_no_island_but_the_last_of_a_label) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    auto image = testing::noise_image<3>({9, 8, 7}, 2 + static_cast<int>(seed), seed);
    const auto before = values(image);
    const auto labels = image.labels;
    const CleanUpReport report = clean(image, 6, 0);
    const auto after = values(image);
    std::int64_t changed = 0, reported = 0;
    for (std::size_t i = 0; i < before.size(); ++i) changed += before[i] != after[i];
    for (const CleanedLabel& l : report.islands) reported += l.voxels;
    EXPECT_LE(changed, reported);  // an island may end up in its own label, once that has taken what was between
    EXPECT_GT(changed, 0);
    for (const std::int32_t l : labels) EXPECT_NE(std::ranges::find(image.labels, l), image.labels.end());
    EXPECT_EQ(image.labels, make_label_image(image.extent, after).labels);  // by first appearance
    std::vector<int> small(image.labels.size());
    for (const ImageComponent& c : image_components(image, Execution(2))) small[c.material] += c.voxels < 6;
    for (std::size_t m = 0; m < small.size(); ++m) EXPECT_TRUE(small[m] <= 1 || image.labels[m] == 0);
  }
}

TEST(clean_up, an_island_takes_the_label_of_most_faces_around_it) {
  // 0 0 1 1 1
  // 0 2 2 1 1    the upper 2s: three faces to 0, two to 1
  // 0 0 3 1 1    the upper 3: one to 0, to 1 and to 2, of which 0 comes first
  // 2 2 2 3 3
  auto image = make_label_image(Coord<2>{5, 4}, {0, 0, 1, 1, 1, 0, 2, 2, 1, 1, 0, 0, 3, 1, 1, 2, 2, 2, 3, 3});
  const CleanUpReport report = clean(image, 3, 0);
  EXPECT_EQ(values(image), (std::vector<std::int32_t>{0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 1, 1, 2, 2, 2, 3, 3}));
  ASSERT_EQ(report.islands.size(), 2U);
  EXPECT_EQ(report.islands[0].label, 2);
  EXPECT_EQ(report.islands[0].voxels, 2);
  EXPECT_EQ(report.islands[1].label, 3);
}

TEST(clean_up, fills_holes_that_are_enclosed) {
  const std::vector<std::int32_t> ring{0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 1, 1, 1, 0};
  auto image = make_label_image(Coord<2>{6, 4}, ring);
  EXPECT_TRUE(clean(image, 0, 2).empty());
  const CleanUpReport report = clean(image, 0, 3);
  EXPECT_EQ(report.holes.voxels, 2);
  EXPECT_EQ(report.holes.components, 1);
  EXPECT_EQ(std::ranges::count(values(image), 1), 12);
  auto open = make_label_image(Coord<2>{6, 3}, {ring.begin() + 6, ring.end()});  // the row above is cut off
  EXPECT_EQ(clean(open, 0, 100).holes.voxels, 2);
  auto side = make_label_image(Coord<2>{6, 3}, {ring.begin(), ring.begin() + 18});  // the hole touches the side
  EXPECT_TRUE(clean(side, 0, 100).empty());
}

}  // namespace
}  // namespace treemarch
