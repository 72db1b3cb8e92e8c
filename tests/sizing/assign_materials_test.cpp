#include "treemarch/sizing/assign_materials.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "support/trees.h"

namespace treemarch {
namespace {

constexpr Coord<2> kExtent{24, 18};

std::vector<std::int32_t> noise(unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(kExtent)));
  for (auto& v : values) v = std::array{4, 4, 4, 9, 9, 2}[random() % 6];
  return values;
}

Spacetree<2> tree_for(const Coord<2>& cells, double density = 0.1, unsigned seed = 2) {
  auto tree = testing::tree_of<2>({{"2", "3"}, kUnbalanced, {cells[0], cells[1]}, seed, density}, 1);
  for (int d = 0; d < 2; ++d) tree.lattice.unit[d] = static_cast<double>(kExtent[d]) / cells[d];
  return tree;
}

/// Area of each label in a leaf, by sampling at the centres of a grid that resolves both cells and voxels.
std::map<std::int32_t, std::int64_t> areas(const Spacetree<2>& tree, const LabelImage<2>& image, const Leaf<2>& leaf) {
  std::map<std::int32_t, std::int64_t> result;
  const auto side = tree.extent_of(leaf);
  for (int y = 0; y < side[1] * image.extent[1]; ++y)
    for (int x = 0; x < side[0] * image.extent[0]; ++x) {
      const int fx = leaf.corner[0] * image.extent[0] + x;
      const int fy = leaf.corner[1] * image.extent[1] + y;
      ++result[image.labels[image.material({fx / tree.lattice.extent[0], fy / tree.lattice.extent[1]})]];
    }
  return result;
}

TEST(AssignMaterials, TakesTheLargestWeightedPart) {
  const auto image = make_label_image<2>(kExtent, noise(1));
  for (const Coord<2>& cells : {Coord<2>{24, 18}, {12, 9}, {7, 5}, {48, 36}, {31, 18}}) {
    for (const double weight : {1.0, 2.5, 0.0}) {
      auto tree = tree_for(cells);
      std::vector<double> weights(image.labels.size(), 1.0);
      for (std::size_t m = 0; m < weights.size(); ++m)
        if (image.labels[m] == 2) weights[m] = weight;
      assign_materials(tree, image, weights, Execution(2));
      for (const auto& leaf : tree.leaves) {
        const auto area = areas(tree, image, leaf);
        const auto value = [&](std::int32_t label) {
          return area.count(label) != 0 ? area.at(label) * (label == 2 ? weight : 1.0) : -1.0;
        };
        ASSERT_LT(leaf.material, image.labels.size());
        for (const auto& [label, n] : area) ASSERT_GE(value(image.labels[leaf.material]), value(label));
      }
    }
  }
}

TEST(AssignMaterials, SmallLeavesTakeTheirVoxel) {
  const auto image = make_label_image<2>(kExtent, noise(2));
  auto tree = tree_for({72, 36}, 1.0);
  assign_materials(tree, image, {}, Execution(1));
  for (const auto& leaf : tree.leaves)
    if (tree.extent_of(leaf) == Coord<2>{1, 1}) {
      EXPECT_EQ(leaf.material, image.material({leaf.corner[0] / 3, leaf.corner[1] / 2}));
    }
}

TEST(AssignMaterials, IgnoresTheValuesAndTheOrientation) {
  // Leaves of 6 x 6 and 3 x 3 voxels with many ties; materials of different frequency, so that ties are decided by it.
  const auto values = noise(3);
  const auto image = make_label_image<2>(kExtent, values);
  auto swapped = values;
  for (auto& v : swapped) v = v == 4 ? 9 : v == 9 ? 2 : 4;
  auto mirrored = values;
  for (int y = 0; y < kExtent[1]; ++y)
    for (int x = 0; x < kExtent[0]; ++x)
      mirrored[static_cast<std::size_t>(x + kExtent[0] * y)] =
          values[static_cast<std::size_t>(kExtent[0] - 1 - x + kExtent[0] * y)];
  const auto other = make_label_image<2>(kExtent, swapped);
  const auto mirror = make_label_image<2>(kExtent, mirrored);
  for (const double density : {0.0, 0.05}) {
    auto tree = tree_for({24, 18}, density);
    auto same = tree;
    assign_materials(tree, image, {}, Execution(1));
    assign_materials(same, other, {}, Execution(1));
    for (std::size_t i = 0; i < tree.leaves.size(); ++i) EXPECT_EQ(tree.leaves[i].material, same.leaves[i].material);
  }
  auto tree = tree_for({24, 18}, 0);
  auto image_side = tree;
  assign_materials(tree, image, {}, Execution(1));
  assign_materials(image_side, mirror, {}, Execution(1));
  for (const auto& leaf : tree.leaves) {
    const auto& there = image_side.leaves[image_side.leaf_at({23 - leaf.corner[0], leaf.corner[1]})];
    EXPECT_EQ(image.labels[leaf.material], mirror.labels[there.material]);
  }
}

TEST(AssignMaterials, TiesGoToTheRarerMaterial) {
  const auto image = make_label_image<1>(Coord<1>{8}, {1, 2, 2, 1, 1, 1, 1, 1});
  auto tree = testing::tree_of<1>({{"2"}, 1, {8}, 1, 0}, 1);
  assign_materials(tree, image, {}, Execution(1));
  ASSERT_EQ(tree.leaves.size(), 4U);
  EXPECT_EQ(image.labels[tree.leaves[0].material], 2);
  EXPECT_EQ(image.labels[tree.leaves[1].material], 2);
  EXPECT_EQ(image.labels[tree.leaves[2].material], 1);
}

}  // namespace
}  // namespace treemarch
