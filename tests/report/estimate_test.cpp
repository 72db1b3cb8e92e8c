#include "treemarch/report/estimate.h"

#include <gtest/gtest.h>

#include "support/images.h"

namespace treemarch {
namespace {

template <int Dim>
double area_by_pairs(const LabelImage<Dim>& image) {
  double area = 0;
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    for (int d = 0; d < Dim; ++d) {
      Coord<Dim> c = coord_of(i, image.extent);
      if (++c[d] == image.extent[d] || image.material(c) == image.voxels[i]) continue;
      double face = 1;
      for (int other = 0; other < Dim; ++other)
        if (other != d) face *= image.frame.spacing[other];
      area += face;
    }
  }
  return area;
}

TEST(Estimate, MeasuresTheInterfaces) {
  Frame<2> flat;
  flat.spacing = {2, 0.5};
  Frame<3> solid;
  solid.spacing = {0.5, 0.7, 3};
  for (unsigned seed = 0; seed < 5; ++seed) {
    const auto image2 = testing::noise_image<2>({9, 14}, 2, seed, flat);
    EXPECT_NEAR(estimate_mesh(image2).interface_area, area_by_pairs(image2), 1e-9);
    const auto image3 = testing::noise_image<3>({9, 4, 7}, 2, seed, solid);
    EXPECT_NEAR(estimate_mesh(image3).interface_area, area_by_pairs(image3), 1e-9);
  }
  EXPECT_EQ(estimate_mesh(testing::noise_image<3>({9, 4, 7}, 1, 0)).interface_area, 0);
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
