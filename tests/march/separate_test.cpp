#include "treemarch/march/separate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/images.h"

namespace treemarch {
namespace {

Field<3> field_of(const LabelImage<3>& image, FieldKind kind) {
  Execution execution(1);
  return build_field(image, {.kind = kind}, execution);
}

std::vector<double> values_at(const Field<3>& field, std::size_t materials, const Vec<3>& at) {
  const auto f = against_the_rest(field);
  std::vector<double> p(materials);
  for (MaterialId m = 0; m < p.size(); ++m) f(m, {&at, 1}, {&p[m], 1});
  return p;
}

std::vector<Vec<3>> random_points(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-0.5, 7);
  std::vector<Vec<3>> points(static_cast<std::size_t>(n));
  for (auto& x : points) x = {u(random), u(random), u(random)};
  return points;
}

TEST(AgainstTheRest, TwoMaterialsShareTheirWeights) {
  const auto image = testing::noise_image<3>({6, 5, 7}, 2, 3);
  for (const FieldKind kind : {FieldKind::linear, FieldKind::bspline3}) {
    const auto field = field_of(image, kind);
    for (const Vec<3>& x : random_points(300, 1)) {
      const auto p = values_at(field, 2, x);
      EXPECT_NEAR(p[0], field.weight(x, 0), 1e-6);
      EXPECT_NEAR(p[0] + p[1], 1, 1e-6);
    }
  }
}

// At any point one material leads, and no two do, unless they tie.
TEST(AgainstTheRest, OneOfManyMaterialsLeads) {
  const auto image = testing::noise_image<3>({6, 5, 7}, 6, 3);
  const std::size_t n = image.labels.size();
  for (const FieldKind kind : {FieldKind::linear, FieldKind::bspline3, FieldKind::gauss, FieldKind::dgf}) {
    const auto field = field_of(image, kind);
    for (const Vec<3>& x : random_points(300, 2)) {
      auto p = values_at(field, n, x);
      const auto best = static_cast<MaterialId>(std::ranges::max_element(p) - p.begin());
      EXPECT_GE(p[best], 0.5);
      for (MaterialId m = 0; m < n; ++m) {
        EXPECT_GE(p[m], 0);
        EXPECT_LE(p[m], 1);
        EXPECT_GE(field.weight(x, best), field.weight(x, m));
        if (m != best) {
          EXPECT_LE(p[m], 0.5);
        }
      }
      std::ranges::sort(p, std::greater<>());
      EXPECT_NEAR(p[0] + p[1], 1, 1e-6) << "the second is as far below as the first is above";
    }
  }
}

TEST(AgainstTheRest, IsSureAtVoxelCentresOfTheLinearField) {
  const auto image = testing::noise_image<3>({6, 5, 7}, 5, 3);
  const auto field = field_of(image, FieldKind::linear);
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    const Coord<3> c = coord_of(i, image.extent);
    const auto p = values_at(field, image.labels.size(), {c[0] + 0.5, c[1] + 0.5, c[2] + 0.5});
    for (MaterialId m = 0; m < p.size(); ++m) EXPECT_EQ(p[m], image.material(c) == m ? 1 : 0);
  }
}

}  // namespace
}  // namespace treemarch
