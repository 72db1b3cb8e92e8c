#include "treemarch/pipeline/material_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "support/images.h"

namespace treemarch {
namespace {

using Order = std::vector<MaterialId>;

// Ids by first appearance: 9, 4, 7, 2; voxels: 1, 3, 3, 2.
LabelImage<2> four_labels() { return make_label_image<2>({9, 1}, {9, 4, 7, 2, 4, 7, 2, 4, 7}); }

TEST(MaterialOrder, SortsAsItSays) {
  const auto image = four_labels();
  EXPECT_EQ(material_order(image, MaterialOrder::image, {}), (Order{0, 1, 2, 3}));
  EXPECT_EQ(material_order(image, MaterialOrder::label, {}), (Order{3, 1, 2, 0}));
  EXPECT_EQ(material_order(image, MaterialOrder::largest, {}), (Order{1, 2, 3, 0}));
  EXPECT_EQ(material_order(image, MaterialOrder::largest, {3, 2}), (Order{3, 2, 1, 0}));
}

TEST(MaterialOrder, NamesAllMaterialsOnce) {
  const auto image = testing::noise_image<3>({9, 8, 7}, 12, 4);
  Order all(image.labels.size());
  std::iota(all.begin(), all.end(), 0U);
  for (const MaterialOrder order :
       {MaterialOrder::largest, MaterialOrder::smallest, MaterialOrder::label, MaterialOrder::image}) {
    for (const Order& first : {Order{}, Order{5}, Order{7, 0, 11}}) {
      Order found = material_order(image, order, first);
      EXPECT_TRUE(std::ranges::equal(first, std::span(found).first(first.size())));
      std::ranges::sort(found);
      EXPECT_EQ(found, all);
    }
  }
}

TEST(MaterialOrder, SmallestIsLargestBackwards) {
  const auto image = testing::noise_image<3>({9, 8, 7}, 12, 4);
  Order order = material_order(image, MaterialOrder::smallest, {});
  std::ranges::reverse(order);
  EXPECT_EQ(order, material_order(image, MaterialOrder::largest, {}));
}

// The size of a material does not depend on what the file calls it.
TEST(MaterialOrder, LabelValuesMatterToLabelOnly) {
  auto image = testing::noise_image<3>({9, 8, 7}, 12, 4);
  const auto before = [&](MaterialOrder order) { return material_order(image, order, {}); };
  const Order largest = before(MaterialOrder::largest), label = before(MaterialOrder::label);
  for (auto& l : image.labels) l = -l;
  EXPECT_EQ(material_order(image, MaterialOrder::largest, {}), largest);
  Order backwards = material_order(image, MaterialOrder::label, {});
  std::ranges::reverse(backwards);
  EXPECT_EQ(backwards, label);
}

}  // namespace
}  // namespace treemarch
