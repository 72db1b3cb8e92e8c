#include "treemarch/march/sharp_shares.h"

#include <gtest/gtest.h>

#include <random>

#include "support/images.h"

namespace treemarch {
namespace {

double share(const LabelImage<4>& image, MaterialId m, const Vec<4>& x) {
  double value = 0;
  sharp_shares(image)(m, {&x, 1}, {&value, 1});
  return value;
}

TEST(SharpShares, AddUpAndAreLinearInTime) {
  Frame<4> frame;
  frame.spacing = {0.5, 1, 2, 0.25};
  const auto image = testing::noise_image<4>({3, 4, 3, 2}, 3, 5, frame);
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    Vec<4> x{};
    for (int d = 0; d < 4; ++d)
      x[d] = image.size()[d] * std::uniform_real_distribution<double>(-0.1, 1.1)(random);  // and a little beyond
    EXPECT_NEAR(share(image, 0, x) + share(image, 1, x) + share(image, 2, x), 1, 1e-12);
    Vec<4> low = x, high = x;
    low[3] = 0.5 * frame.spacing[3];
    high[3] = 1.5 * frame.spacing[3];
    x[3] = frame.spacing[3];
    EXPECT_NEAR(share(image, 1, x), 0.5 * (share(image, 1, low) + share(image, 1, high)), 1e-12);
  }
}

/// A flat boundary is where it is in the image; away from it the share is 0 or 1.
TEST(SharpShares, KeepFlatBoundaries) {
  const Coord<4> extent{8, 5, 4, 2};
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) values.push_back(coord_of(i, extent)[0] < 4 ? 0 : 7);
  const auto image = make_label_image<4>(extent, values);
  std::mt19937 random(5);
  for (int i = 0; i < 50; ++i) {
    Vec<4> x{};
    for (int d = 1; d < 4; ++d) x[d] = image.size()[d] * std::uniform_real_distribution<double>(0, 1)(random);
    x[0] = 4;
    EXPECT_NEAR(share(image, 1, x), 0.5, 1e-12);
    x[0] = 2.4;
    EXPECT_NEAR(share(image, 1, x), 0, 1e-12);
    x[0] = 5.6;
    EXPECT_NEAR(share(image, 1, x), 1, 1e-12);
  }
}

}  // namespace
}  // namespace treemarch
