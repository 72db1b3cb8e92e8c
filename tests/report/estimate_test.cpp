#include "treemarch/report/estimate.h"

#include <gtest/gtest.h>

#include "support/images.h"

namespace treemarch {
namespace {

template <int Dim>
std::int64_t count_at_interfaces(const LabelImage<Dim>& image) {
  std::int64_t n = 0;
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    bool differs = false;
    for (int d = 0; d < Dim; ++d) {
      for (const int step : {-1, 1}) {
        Coord<Dim> c = coord_of(i, image.extent);
        c[d] += step;
        differs |= c[d] >= 0 && c[d] < image.extent[d] && image.material(c) != image.voxels[i];
      }
    }
    n += differs;
  }
  return n;
}

TEST(Estimate, CountsVoxelsAtInterfaces) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const auto flat = testing::noise_image<2>({9, 14}, 2, seed);
    EXPECT_EQ(estimate_mesh(flat).interface_voxels, count_at_interfaces(flat));
    const auto solid = testing::noise_image<3>({9, 4, 7}, 2, seed);
    EXPECT_EQ(estimate_mesh(solid).interface_voxels, count_at_interfaces(solid));
  }
  EXPECT_EQ(estimate_mesh(testing::noise_image<3>({9, 4, 7}, 1, 0)).interface_voxels, 0);
}

TEST(Estimate, GrowsWithTheInterface) {
  const auto small = estimate_mesh(testing::ball_image<3>({40, 40, 40}, 0.2));
  const auto large = estimate_mesh(testing::ball_image<3>({40, 40, 40}, 0.4));
  EXPECT_GT(small.cells, 0);
  EXPECT_GT(large.cells, 3 * small.cells);
  EXPECT_GT(large.memory_bytes, small.memory_bytes);
}

}  // namespace
}  // namespace treemarch
