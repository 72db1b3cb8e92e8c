#include "treemarch/field/block_builder.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "field/lists.h"
#include "field/shapes.h"

namespace treemarch {
namespace {

template <class T>
class BlockBuilderTest : public testing::Test {};
template <int D>
struct Dimension {
  static constexpr int value = D;
};
using Dimensions = testing::Types<Dimension<2>, Dimension<3>>;
TYPED_TEST_SUITE(BlockBuilderTest, Dimensions);

TYPED_TEST(BlockBuilderTest, ListsStartWithTheOwnLabelAndFlagWhereItHardlyWins) {
  constexpr int kDim = TypeParam::value;
  for (int labels : {1, 2, 20, 500})
    for (int patch : {1, 6}) {
      const auto image = random_labels<kDim>(box<kDim>({39, 37, 18}), labels, patch, 4);
      std::vector<std::uint64_t> flagged;
      const auto lists = lists_of(image, debiased_filter<kDim>(), flagged);
      for (std::int64_t i = 0; i < product(image.extent); ++i) {
        const auto c = coord_of(i, image.extent);
        std::vector<MaterialId> materials;
        std::vector<std::uint32_t> weights;
        const int place = VoxelLists<kDim>::place_in_brick(c);
        const std::int64_t brick = lists.brick_of(c);
        lists.visit_voxel(lists.refs[brick], place, [&](MaterialId m, std::uint32_t w) {
          EXPECT_EQ(std::count(materials.begin(), materials.end(), m), 0);
          materials.push_back(m);
          weights.push_back(w);
        });
        ASSERT_FALSE(materials.empty());
        ASSERT_EQ(materials[0], image.material(c));
        const std::uint32_t best = weights.size() > 1 ? *std::max_element(weights.begin() + 1, weights.end()) : 0;
        ASSERT_EQ((flagged[brick] >> place & 1) != 0, weights[0] < best + VoxelLists<kDim>::kOne / 10);
      }
    }
}

TYPED_TEST(BlockBuilderTest, WithoutAFilterEachVoxelHasItsOwnLabelAlone) {
  constexpr int kDim = TypeParam::value;
  const auto image = random_labels<kDim>(box<kDim>({39, 37, 18}), 5, 3, 4);
  std::vector<std::uint64_t> flagged;
  const auto lists = lists_of(image, IndicatorFilter{}, flagged);
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    const auto c = coord_of(i, image.extent);
    int entries = 0;
    lists.visit_voxel(lists.refs[lists.brick_of(c)], VoxelLists<kDim>::place_in_brick(c),
                      [&](MaterialId m, std::uint32_t w) {
                        ++entries;
                        EXPECT_EQ(m, image.material(c));
                        EXPECT_EQ(w, VoxelLists<kDim>::kOne);
                      });
    ASSERT_EQ(entries, 1);
  }
}

TEST(IndicatorFilter, RadiusIsThatOfTheWiderKernel) {
  EXPECT_EQ(IndicatorFilter{}.radius(), 0);
  EXPECT_EQ(debiased_filter<3>().radius(), 4);
}

}  // namespace
}  // namespace treemarch
