#include "treemarch/sizing/places.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/images.h"

namespace treemarch {
namespace {

/// Turned by 30 degrees about the last axis, mirrored, shifted, with sides of their own.
Frame<3> oblique() {
  Frame<3> frame;
  frame.spacing = {0.5, 1, 2};
  const double c = std::sqrt(0.75), s = 0.5;
  frame.direction = {Vec<3>{c, s, 0}, Vec<3>{s, -c, 0}, Vec<3>{0, 0, 1}};
  frame.origin = {10, -20, 30};
  return frame;
}

Vec<3> world_of(const LabelImage<3>& image, std::int64_t i) {
  const Coord<3> c = coord_of(i, image.extent);
  Vec<3> x;
  for (int d = 0; d < 3; ++d) x[d] = (c[d] + 0.5) * image.frame.spacing[d];
  return to_world(image.frame, x);
}

TEST(Places, BoxesAndBallsAreThoseOfTheWorld) {
  const auto image = testing::noise_image<3>({20, 12, 8}, 3, 1, oblique());
  SizedPlace<3> box{.low = {10, -22, 31}, .high = {14, -17, 40}, .size = 2};
  SizedPlace<3> ball{.is_ball = true, .low = {13, -20, 36}, .radius = 4, .size = 0.5};
  std::vector<float> sizes;
  std::int64_t in_box = 0, in_ball = 0;
  EXPECT_GT(add_place(image, box, sizes), 0);
  EXPECT_GT(add_place(image, ball, sizes), 0);
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    const Vec<3> x = world_of(image, i);
    bool boxed = true;
    for (int d = 0; d < 3; ++d) boxed = boxed && x[d] >= box.low[d] && x[d] <= box.high[d];
    const bool balled = norm(x - ball.low) <= ball.radius;
    in_box += boxed;
    in_ball += balled;
    ASSERT_EQ(sizes[i], balled ? 0.5F : boxed ? 2.0F : 0.0F) << i;
  }
  std::vector<float> again;
  EXPECT_EQ(add_place(image, box, again), in_box);
  EXPECT_EQ(add_place(image, ball, again), in_ball);
  ball.low = {900, 0, 0};
  EXPECT_EQ(add_place(image, ball, again), 0);
}

TEST(Places, SizeImagesAreFoundByTheWorld) {
  const auto image = testing::noise_image<3>({20, 12, 8}, 3, 1, oblique());
  // Half the voxels along each axis of the same box, and the same place: its voxel centres lie between those of the
  // image.
  GreyImage<3> values{{10, 6, 4}, image.frame, {}};
  for (int d = 0; d < 3; ++d) values.frame.spacing[d] *= 2;
  Vec<3> first{};
  for (int d = 0; d < 3; ++d) first[d] = image.frame.spacing[d];
  values.frame.origin = to_world(image.frame, first);
  for (int i = 0; i < 240; ++i) values.values.push_back(i % 7 == 0 ? 0.0F : static_cast<float>(i));
  values.values[3] = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> sizes;
  add_size_image(image, values, sizes);
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    Coord<3> c = coord_of(i, image.extent);
    for (int d = 0; d < 3; ++d) c[d] /= 2;
    const float value = values.values[static_cast<std::size_t>(linear_index(c, values.extent))];
    ASSERT_EQ(sizes[i], value > 0 ? value : 0) << i;
  }
  values.frame.origin[2] += 1000;
  std::vector<float> none;
  EXPECT_EQ(add_size_image(image, values, none), 0);
}

}  // namespace
}  // namespace treemarch
