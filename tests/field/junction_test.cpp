#include "treemarch/field/junction.h"

#include <gtest/gtest.h>

#include <array>

#include "field/shapes.h"

namespace treemarch {
namespace {

/// Four materials: a half space, whose other half is cut into three wedges or boxes that meet in a point.
LabelImage<3> four_materials() {
  return image_of<3>({20, 20, 20}, [](const Coord<3>& c) { return c[2] < 9 ? 0 : c[0] < 11 ? 1 : c[1] < 10 ? 2 : 3; });
}

TEST(Junction, MovedPointsWeighTheSame) {
  Execution execution(1);
  const auto image = four_materials();
  const auto field = build_field(image, {}, execution);
  const std::array<MaterialId, 4> all{0, 1, 2, 3};
  for (std::size_t count : {2, 3, 4}) {
    const std::span<const MaterialId> labels(all.data(), count);
    for (double off : {-0.4, 0.1, 0.35}) {
      const Vec<3> start{11 + off, count == 2 ? 6.0 : 10 - off, 9 + 0.5 * off};
      // A junction of two or three labels is looked for where no other label is near.
      const Vec<3> from = count == 3 ? Vec<3>{11 + off, 4.3, 9 + off} : count == 2 ? Vec<3>{5.2, 6.1, 9 + off} : start;
      const Vec<3> x = move_to_junction<3>(field, from, labels, 0U, 8);
      EXPECT_LT(norm(x - from), 1.5);
      for (std::size_t k = 1; k < count; ++k)
        EXPECT_NEAR(field.difference(x, labels[0], labels[k]), 0, 0.02) << count << " labels";
    }
  }
}

TEST(Junction, FixedAxesStay) {
  Execution execution(1);
  const auto image = four_materials();
  const auto field = build_field(image, {}, execution);
  const std::array<MaterialId, 2> labels{0, 1};
  const Vec<3> from{5.25, 6.0, 9.3};
  const Vec<3> x = move_to_junction<3>(field, from, labels, 0b100U, 3);
  EXPECT_EQ(x[2], from[2]);
}

TEST(Junction, BestDifferenceIsThatOfTheLargest) {
  Execution execution(1);
  const auto image = four_materials();
  const auto field = build_field(image, {}, execution);
  const std::array<MaterialId, 2> a{0, 1};
  const std::array<MaterialId, 2> b{2, 3};
  for (const auto& x : random_points(image, 200, 3)) {
    const float best_a = std::max(field.weight(x, 0), field.weight(x, 1));
    const float best_b = std::max(field.weight(x, 2), field.weight(x, 3));
    EXPECT_NEAR(best_difference<3>(field, x, a, b), best_a - best_b, 1e-6F);
  }
}

}  // namespace
}  // namespace treemarch
