#include "treemarch/image/label_image.h"

#include <gtest/gtest.h>

#include <random>

namespace treemarch {
namespace {

TEST(MakeLabelImage, PermutedLabelsGiveTheSameMaterials) {
  std::mt19937 random(3);
  std::vector<std::int32_t> values(1000), permuted(1000);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<std::int32_t>(random() % 20);
    permuted[i] = 1'000'000 - 7 * values[i];
  }
  const auto a = make_label_image<3>({10, 10, 10}, values);
  const auto b = make_label_image<3>({10, 10, 10}, permuted);
  for (std::int64_t i = 0; i < a.voxels.size(); ++i) EXPECT_EQ(a.voxels[i], b.voxels[i]);
  for (std::size_t m = 0; m < a.labels.size(); ++m) EXPECT_EQ(b.labels[m], 1'000'000 - 7 * a.labels[m]);
}

TEST(MakeLabelImage, EmptyImage) {
  const auto image = make_label_image<2>({0, 0}, {});
  EXPECT_EQ(image.voxels.size(), 0);
  EXPECT_TRUE(image.labels.empty());
}

}  // namespace
}  // namespace treemarch
