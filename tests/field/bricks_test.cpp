#include "treemarch/field/bricks.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>

#include "field/lists.h"
#include "field/shapes.h"
#include "treemarch/field/field.h"

namespace treemarch {
namespace {

template <class T>
class BricksTest : public testing::Test {};
template <int D>
struct Dimension {
  static constexpr int value = D;
};
using Dimensions = testing::Types<Dimension<2>, Dimension<3>>;
TYPED_TEST_SUITE(BricksTest, Dimensions);

TYPED_TEST(BricksTest, EveryFormHoldsWhatTheListsHold) {
  constexpr int kDim = TypeParam::value;
  const Execution execution(2);
  std::set<unsigned> forms;
  for (int labels : {2, 3, 6, 200})
    for (int patch : {1, 4, 9}) {
      const auto image = random_labels<kDim>(box<kDim>({39, 37, 18}), labels, patch, 4);
      std::vector<std::uint64_t> flagged;
      const auto lists = lists_of(image, debiased_filter<kDim>(), flagged);
      const auto bricks = make_bricks(lists, execution);
      const Field<kDim> field(FieldKind::dgf, image.frame.spacing, bricks);
      for (std::uint64_t ref : bricks.refs)
        forms.insert((ref & Bricks<kDim>::kUniform) != 0 ? 99U : static_cast<unsigned>(Bricks<kDim>::form_of(ref)));
      for (std::int64_t i = 0; i < product(image.extent); ++i) {
        const auto c = coord_of(i, image.extent);
        ASSERT_EQ(bricks.own(c), image.material(c));
        std::map<MaterialId, float> expected;
        std::map<MaterialId, float> found;
        lists.visit_voxel(lists.refs[lists.brick_of(c)], VoxelLists<kDim>::place_in_brick(c),
                          [&](MaterialId m, std::uint32_t w) {
                            if (w > 0) expected[m] = static_cast<float>(w) / Bricks<kDim>::kOne;
                          });
        std::array<LabelWeight, 64> out;
        const int n = field.sample(centre_of(c), out);
        for (int k = 0; k < n; ++k) found[out[k].material] = out[k].weight;
        if (n == 1 && out[0].weight == 1) {
          ASSERT_EQ(expected.size(), 1U);  // a brick of one label: it weighs 1
          ASSERT_EQ(expected.begin()->first, out[0].material);
        } else {
          ASSERT_EQ(found, expected);
        }
      }
    }
  EXPECT_EQ(forms, (std::set<unsigned>{Bricks<kDim>::kLists, Bricks<kDim>::kTable2, Bricks<kDim>::kTable4,
                                       Bricks<kDim>::kTable8, 99}));
}

TYPED_TEST(BricksTest, ImagesOfOneVoxelAndOfOddExtents) {
  constexpr int kDim = TypeParam::value;
  for (std::array<std::int32_t, 3> sides : {std::array{1, 1, 1}, {4, 8, 4}, {5, 9, 1}, {1, 17, 33}}) {
    const auto image = random_labels<kDim>(box<kDim>(sides), 3, 1, 8);
    Execution execution(1);
    FieldOptions options;
    options.kind = FieldKind::linear;
    const auto field = build_field(image, options, execution);
    for (std::int64_t i = 0; i < product(image.extent); ++i) {
      const auto c = coord_of(i, image.extent);
      EXPECT_EQ(field.weight(centre_of(c), image.material(c)), 1.0F);
    }
  }
}

}  // namespace
}  // namespace treemarch
