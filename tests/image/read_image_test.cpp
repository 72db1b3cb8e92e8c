#include "treemarch/image/read_image.h"

#include <gtest/gtest.h>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

TEST(ReadImage, RealImage) {
  const Execution execution(2);
  const AnyImage any = read_label_image(TREEMARCH_DATA "/abdomen_ct_61organs.nii.gz", {}, execution);
  const auto& image = std::get<LabelImage<3>>(any);
  EXPECT_EQ(image.extent, (Coord<3>{122, 101, 112}));
  EXPECT_EQ(image.labels.size(), 62U);
  EXPECT_EQ(image.frame.space, "RAS");
  std::vector<std::int64_t> count(image.labels.size());
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) ++count[image.voxels[i]];
  EXPECT_EQ(count[0], 1034076);
  for (int d = 0; d < 3; ++d) EXPECT_NEAR(image.frame.spacing[d], 3, 1e-6);
  EXPECT_NEAR(image.frame.origin[0], -177.956329, 1e-5);
  EXPECT_NEAR(image.frame.origin[1], 11.3190002, 1e-5);
  EXPECT_NEAR(image.frame.origin[2], 94.3017578, 1e-5);
}

}  // namespace
}  // namespace treemarch
