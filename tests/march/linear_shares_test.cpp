#include "treemarch/march/linear_shares.h"

#include <gtest/gtest.h>

#include <random>

#include "support/images.h"

namespace treemarch {
namespace {

TEST(LinearShares, AddUpAndAgreeWithTheVoxelsAtTheirCentres) {
  Frame<4> frame;
  frame.spacing = {0.5, 1, 2, 0.25};
  const auto image = testing::noise_image<4>({3, 4, 3, 2}, 3, 5, frame);
  const MaterialField<4> field = linear_shares(image);
  const auto share = [&](MaterialId m, const Vec<4>& x) {
    double value = 0;
    field(m, {&x, 1}, {&value, 1});
    return value;
  };
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    const Coord<4> c = coord_of(i, image.extent);
    Vec<4> centre{};
    for (int d = 0; d < 4; ++d) centre[d] = (c[d] + 0.5) * frame.spacing[d];
    for (MaterialId m = 0; m < 3; ++m) EXPECT_EQ(share(m, centre), image.voxels[i] == m ? 1 : 0);
  }
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    Vec<4> x{};
    for (int d = 0; d < 4; ++d)
      x[d] = image.size()[d] * std::uniform_real_distribution<double>(-0.1, 1.1)(random);  // and a little beyond
    EXPECT_NEAR(share(0, x) + share(1, x) + share(2, x), 1, 1e-12);
    // Linear between neighbours: what moves halfway along one axis is the mean of the ends.
    Vec<4> low = x, high = x;
    const int axis = i % 4;
    low[axis] = 0.5 * frame.spacing[axis];
    high[axis] = 1.5 * frame.spacing[axis];
    x[axis] = frame.spacing[axis];
    EXPECT_NEAR(share(1, x), 0.5 * (share(1, low) + share(1, high)), 1e-12);
  }
}

}  // namespace
}  // namespace treemarch
