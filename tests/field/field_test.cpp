#include "treemarch/field/field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "field/shapes.h"

namespace treemarch {
namespace {

constexpr FieldKind kAllKinds[] = {FieldKind::linear, FieldKind::bspline3, FieldKind::gauss, FieldKind::dgf,
                                   FieldKind::solid_angle};

template <int Dim>
Field<Dim> field_of(const LabelImage<Dim>& image, FieldKind kind, int threads = 2) {
  Execution execution(threads);
  FieldOptions options;
  options.kind = kind;
  return build_field(image, options, execution);
}

std::vector<LabelWeight> entries_at(const auto& field, const auto& x) {
  std::array<LabelWeight, 256> out;
  const int n = field.sample(x, out);
  return {out.begin(), out.begin() + n};
}

template <class T>
class FieldTest : public testing::Test {};
template <int D>
struct Dimension {
  static constexpr int value = D;
};
using Dimensions = testing::Types<Dimension<2>, Dimension<3>>;
TYPED_TEST_SUITE(FieldTest, Dimensions);

TYPED_TEST(FieldTest, OneLabelWeighsOneEverywhere) {
  constexpr int kDim = TypeParam::value;
  const auto image = random_labels<kDim>(box<kDim>({9, 5, 17}), 1, 1, 1);
  for (FieldKind kind : kAllKinds) {
    const auto field = field_of(image, kind);
    for (const auto& x : random_points(image, 300, 2)) {
      const auto e = entries_at(field, x);
      ASSERT_EQ(e.size(), 1U);
      EXPECT_EQ(e[0].material, 0U);
      EXPECT_EQ(e[0].weight, 1.0F);
    }
  }
}

/// The slope is that of the line through two points close by, unless a face between cells of voxel centres lies
/// between.
TYPED_TEST(FieldTest, DifferenceAlongHasTheSlope) {
  constexpr int kDim = TypeParam::value;
  constexpr double kStep = 1e-2;
  auto image = random_labels<kDim>(box<kDim>({14, 12, 13}), 12, 2, 5);
  image.frame.spacing[0] = 1.5;
  for (const FieldKind kind : {FieldKind::linear, FieldKind::gauss, FieldKind::dgf}) {
    const auto field = field_of(image, kind);
    const auto directions = random_points(image, 2000, 4);
    int compared = 0, sloping = 0;
    for (std::size_t i = 0; const auto& x : random_points(image, 2000, 3)) {
      const auto direction = (1 / norm(directions[i])) * directions[i];
      ++i;
      const auto e = entries_at(field, x);
      if (e.size() < 2) continue;
      const auto [value, slope] = field.difference_along(x, direction, e[0].material, e[1].material);
      EXPECT_NEAR(value, field.difference(x, e[0].material, e[1].material), 1e-6);
      bool in_one_cell = true;
      for (int d = 0; d < kDim; ++d) {
        const double u = x[d] / image.frame.spacing[d] - 0.5;
        in_one_cell &= std::abs(u - std::round(u)) > 2 * kStep;
      }
      if (!in_one_cell) continue;
      const auto at = [&](double t) { return field.difference(x + t * direction, e[0].material, e[1].material); };
      EXPECT_NEAR(slope, (at(kStep) - at(-kStep)) / (2 * kStep), 1e-3);
      ++compared;
      sloping += std::abs(slope) > 0.1F ? 1 : 0;
    }
    EXPECT_GT(compared, 500);
    EXPECT_GT(sloping, 200);
  }
}

TYPED_TEST(FieldTest, WeightsAddUpToOne) {
  constexpr int kDim = TypeParam::value;
  for (int patch : {1, 5}) {
    const auto image = random_labels<kDim>(box<kDim>({37, 21, 19}), 3, patch, 7);
    for (FieldKind kind : kAllKinds) {
      FieldOptions options;
      options.kind = kind;
      options.keep_thin = false;  // what is thin weighs up to 1.9
      Execution execution(2);
      const auto field = build_field(image, options, execution);
      for (const auto& x : random_points(image, 1000, 3)) {
        double sum = 0;
        for (const LabelWeight& e : entries_at(field, x)) sum += e.weight;
        // What is negative in the debiased field is cut off, and weights below 1/512 are left out.
        const double over = kind == FieldKind::dgf ? 0.3 : 1e-4;
        const double under = kind == FieldKind::dgf || kind == FieldKind::gauss ? 0.005 : 1e-4;
        EXPECT_GT(sum, 1 - under);
        EXPECT_LT(sum, 1 + over);
      }
    }
  }
}

TYPED_TEST(FieldTest, SampleWeightAndDifferenceAgree) {
  constexpr int kDim = TypeParam::value;
  const auto image = random_labels<kDim>(box<kDim>({37, 21, 19}), 5, 3, 7);
  for (FieldKind kind : kAllKinds) {
    const auto field = field_of(image, kind);
    for (const auto& x : random_points(image, 1000, 3)) {
      const auto e = entries_at(field, x);
      for (std::size_t i = 0; i < e.size(); ++i) {
        EXPECT_EQ(e[i].weight, field.weight(x, e[i].material));
        if (i == 0) continue;
        EXPECT_NEAR(field.difference(x, e[0].material, e[i].material), e[0].weight - e[i].weight, 2e-7);
        EXPECT_GE(e[i - 1].weight, e[i].weight);
      }
      std::array<LabelWeight, 2> two{};
      const int n = field.sample(x, two);
      ASSERT_EQ(n, std::min<int>(2, static_cast<int>(e.size())));
      for (int i = 0; i < n; ++i) EXPECT_EQ(two[i].material, e[i].material);
    }
  }
}

TYPED_TEST(FieldTest, VoxelLabelIsTheImagesOwn) {
  constexpr int kDim = TypeParam::value;
  auto image = random_labels<kDim>(box<kDim>({37, 21, 19}), 5, 4, 7);
  for (int d = 0; d < kDim; ++d) image.frame.spacing[d] = 0.3 + 1.1 * d;
  for (FieldKind kind : kAllKinds) {
    const auto field = field_of(image, kind);
    for (std::int64_t i = 0; i < product(image.extent); ++i) {
      const auto c = coord_of(i, image.extent);
      Vec<kDim> x{};
      for (int d = 0; d < kDim; ++d) x[d] = (c[d] + 0.5) * image.frame.spacing[d];
      ASSERT_EQ(field.voxel_label(x), image.material(c));
      if (kind == FieldKind::linear || kind == FieldKind::solid_angle) {
        ASSERT_NEAR(field.weight(x, image.material(c)), 1.0F, 1e-6F);
      }
    }
  }
}

}  // namespace
}  // namespace treemarch
