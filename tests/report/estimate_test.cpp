#include "treemarch/report/estimate.h"

#include <gtest/gtest.h>

#include "support/images.h"
#include "treemarch/core/error.h"

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
    EXPECT_NEAR(estimate_mesh(image2, {}, false, Execution(2)).interface_area, area_by_pairs(image2), 1e-9);
    const auto image3 = testing::noise_image<3>({9, 4, 7}, 2, seed, solid);
    EXPECT_NEAR(estimate_mesh(image3, {}, false, Execution(3)).interface_area, area_by_pairs(image3), 1e-9);
  }
  EXPECT_EQ(estimate_mesh(testing::noise_image<3>({9, 4, 7}, 1, 0), {}, false, Execution(1)).interface_area, 0);
}

TEST(Estimate, GrowsWithTheInterface) {
  const auto small = estimate_mesh(testing::ball_image<3>({40, 40, 40}, 0.2), {}, false, Execution(2));
  const auto large = estimate_mesh(testing::ball_image<3>({40, 40, 40}, 0.4), {}, false, Execution(2));
  EXPECT_GT(small.cells, 0);
  EXPECT_GT(large.cells, 3 * small.cells);
  EXPECT_GT(large.memory_bytes, small.memory_bytes);
}

TEST(Estimate, GrowsWithFinerCells) {
  const auto image = testing::ball_image<3>({40, 40, 40}, 0.4);
  SizingRule fine, coarse, uniform;
  fine.min_size = 1;
  coarse.min_size = 4;
  uniform.min_size = uniform.max_size = 1;
  const Execution execution(2);
  EXPECT_GT(estimate_mesh(image, fine, false, execution).cells,
            10 * estimate_mesh(image, coarse, false, execution).cells);
  EXPECT_GT(estimate_mesh(image, uniform, false, execution).cells, 12 * product(image.extent));
}

TEST(Estimate, CountsWhatIsHeldForEachVoxel) {
  LabelImage<3> image = testing::ball_image<3>({40, 40, 40}, 0.4);
  const auto memory = [&](const SizingRule& sizes, bool grey) {
    return estimate_mesh(image, sizes, grey, Execution(2)).memory_bytes;
  };
  const std::int64_t plain = memory({}, false), voxels = product(image.extent);
  EXPECT_EQ(memory({}, true), plain + 4 * voxels);
  SizingRule sized;
  sized.voxel_size.resize(static_cast<std::size_t>(voxels));
  EXPECT_EQ(memory(sized, false), plain + 5 * voxels);
  EXPECT_EQ(memory({.few_voxels = {{7, 1}}}, false), plain + voxels);
  CompactArray wide(voxels, 1 << 20);
  for (std::int64_t i = 0; i < voxels; ++i) wide.set(i, image.voxels[i]);
  image.voxels = wide;
  EXPECT_EQ(memory({}, false), plain + 3 * voxels);
}

TEST(Estimate, AmountsOfMemoryHaveUnits) {
  EXPECT_EQ(parse_bytes("12GB", "--x"), 12'000'000'000);
  EXPECT_EQ(parse_bytes("1.5G", "--x"), 1'500'000'000);
  EXPECT_EQ(parse_bytes("2GiB", "--x"), std::int64_t{1} << 31);
  EXPECT_EQ(parse_bytes("900MB", "--x"), 900'000'000);
  EXPECT_EQ(parse_bytes("4096", "--x"), 4096);
  for (const char* bad : {"", "GB", "-1GB", "0", "1TBB", "1 GB", "nan", "1e30"})
    EXPECT_THROW(parse_bytes(bad, "--x"), Error);
}

TEST(Estimate, WhatDoesNotFitIsRefusedWithTheNumbers) {
  MeshEstimate estimate;
  estimate.cells = 20'000'000;
  estimate.memory_bytes = 3'000'000'000;
  EXPECT_NO_THROW(require_memory(estimate, 3'000'000'000));
  try {
    require_memory(estimate, 2'000'000'000);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::limits);
    EXPECT_NE(std::string(e.what()).find("20.0 million cells need about 3.0 GB, and 2.0 GB"), std::string::npos);
  }
  EXPECT_GT(available_memory_bytes(), 0);
}

TEST(Estimate, ADiskHoldsTheRestIfItHasTheRoom) {
  MeshEstimate estimate;
  estimate.cells = 20'000'000;
  estimate.memory_bytes = 3'000'000'000;
  EXPECT_NO_THROW(require_disk(estimate, 3'000'000'000, 0, "place"));
  EXPECT_NO_THROW(require_disk(estimate, 1'000'000'000, 5'000'000'000, "place"));
  try {
    require_disk(estimate, 1'000'000'000, 3'500'000'000, "place");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::limits);
    EXPECT_NE(std::string(e.what()).find("3.8 GB, for which 3.5 GB are free in place"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace treemarch
