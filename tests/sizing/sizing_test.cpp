#include "treemarch/sizing/sizing.h"

#include <gtest/gtest.h>

#include <random>

#include "support/trees.h"

namespace treemarch {
namespace {

/// Four materials in random blocks.
LabelImage<3> blocks(const Coord<3>& extent, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::int32_t> coarse(1000);
  for (auto& v : coarse) v = static_cast<std::int32_t>(random() % 4) * 10;
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const auto c = coord_of(i, extent);
    values.push_back(coarse[static_cast<std::size_t>(c[0] / 5 + 10 * (c[1] / 4) + 100 * (c[2] / 6))]);
  }
  return make_label_image<3>(extent, values);
}

SizedLattice<3> sized_for(const LabelImage<3>& image, const std::vector<std::string>& pattern, Coord<3> cells) {
  SizedLattice<3> sized;
  sized.pattern = testing::pattern_of<3>(pattern);
  sized.deepest_level = sized.pattern.finest_level();
  sized.lattice.extent = cells;
  for (int d = 0; d < 3; ++d) sized.lattice.unit[d] = image.size()[d] / cells[d];
  return sized;
}

/// Sizes as the rule words them, for one voxel.
double size_of(const LabelImage<3>& image, const SizingRule& rule, Coord<3> c) {
  const auto material_size = [&](MaterialId m) {
    return m < rule.material_size.size() && rule.material_size[m] > 0 ? rule.material_size[m] : rule.max_size;
  };
  const auto interface_size = [&](MaterialId m) {
    const auto& sizes = rule.material_interface_size;
    return m < sizes.size() && sizes[m] > 0 ? sizes[m] : rule.min_size;
  };
  const MaterialId own = image.material(c);
  double size = 1e9;
  for (int d = 0; d < 3; ++d)
    for (const int step : {-1, 1}) {
      Coord<3> n = c;
      n[d] += step;
      if (n[d] < 0 || n[d] >= image.extent[d] || image.material(n) == own) continue;
      const MaterialId other = image.material(n);
      double s = std::min({interface_size(own), interface_size(other), material_size(own), material_size(other)});
      for (const auto& i : rule.interface_size)
        if ((i.first == own && i.second == other) || (i.second == own && i.first == other)) s = i.size;
      size = std::min(size, s);
    }
  return size < 1e9 ? size : material_size(own);
}

TEST(RequiredLevels, FollowTheRuleVoxelByVoxel) {
  const auto image = blocks({40, 24, 36}, 5);
  const auto sized = sized_for(image, {"2", "2", "2", "2"}, image.extent);
  std::vector<SizingRule> rules(4);
  rules[0] = {.min_size = 1, .max_size = 16, .material_size = {}, .interface_size = {}};
  rules[1] = {.min_size = 3, .max_size = 16, .material_size = {0, 4, 1}, .interface_size = {}};
  rules[2] = {.min_size = 2, .max_size = 8, .material_size = {4}, .interface_size = {{1, 0, 8}, {2, 3, 1}}};
  rules[3] = rules[1];
  rules[3].material_interface_size = {8, 0, 1, 2};
  for (const SizingRule& rule : rules) {
    const Execution execution(2);
    const auto levels = required_levels(image, sized, rule, execution);
    ASSERT_EQ(levels.size(), static_cast<std::size_t>(product(image.extent)));
    for (std::int64_t i = 0; i < product(image.extent); ++i) {
      const double size = size_of(image, rule, coord_of(i, image.extent));
      // The sides are 16, 8, 4, 2 and 1.
      const int expected = size >= 16 ? 0 : size >= 8 ? 1 : size >= 4 ? 2 : size >= 2 ? 3 : 4;
      ASSERT_EQ(levels[i], expected) << i;
    }
  }
}

TEST(RequiredLevels, CellsOfAnySizeTakeTheFinestDemandOfTheirVoxels) {
  const auto image = blocks({40, 24, 36}, 6);
  const SizingRule rule{.min_size = 1e-3, .max_size = 1e3, .material_size = {}, .interface_size = {}};
  const Execution execution(1);
  const auto voxel = required_levels(image, sized_for(image, {"2"}, image.extent), rule, execution);
  for (const Coord<3>& cells : {Coord<3>{20, 12, 18}, {13, 24, 7}, {80, 24, 108}, {57, 31, 36}, {1, 1, 1}}) {
    const auto levels = required_levels(image, sized_for(image, {"2"}, cells), rule, execution);
    ASSERT_EQ(levels.size(), static_cast<std::size_t>(product(cells)));
    for (std::int64_t i = 0; i < product(cells); ++i) {
      const auto c = coord_of(i, cells);
      int expected = 0;
      for (std::int64_t v = 0; v < product(image.extent); ++v) {
        const auto x = coord_of(v, image.extent);
        bool overlap = true;
        for (int d = 0; d < 3; ++d)
          overlap = overlap && x[d] * cells[d] < (c[d] + 1) * image.extent[d] &&
                    (x[d] + 1) * cells[d] > c[d] * image.extent[d];
        if (overlap) expected = std::max<int>(expected, voxel[v]);
        if (overlap && expected > 0) break;
      }
      ASSERT_EQ(levels[i], expected) << i;
      if (i > 3000) break;  // enough of each; the loop above is slow
    }
  }
}

TEST(RequiredLevels, SizesOfFewVoxelsAreThoseOfAListOfAll) {
  const auto image = blocks({40, 24, 36}, 8);
  SizingRule all{.min_size = 8, .max_size = 16}, few = all;
  all.voxel_size.resize(static_cast<std::size_t>(product(image.extent)));
  for (std::int64_t v = 0; v < product(image.extent); v += 977) {
    few.few_voxels.push_back({v, v % 2 ? 1.0F : 2.5F});
    all.voxel_size[static_cast<std::size_t>(v)] = few.few_voxels.back().size;
  }
  const Execution execution(2);
  for (const Coord<3>& cells : {image.extent, Coord<3>{20, 12, 18}, {57, 31, 36}}) {
    const auto sized = sized_for(image, {"2", "2", "2", "2"}, cells);
    const auto levels = required_levels(image, sized, few, execution);
    EXPECT_EQ(levels, required_levels(image, sized, all, execution));
    EXPECT_NE(levels, required_levels(image, sized, {.min_size = 8, .max_size = 16}, execution));
  }
  EXPECT_EQ(smallest_size(few, 0), 1);
}

TEST(RequiredLevels, NoSizeAsksForTheLevelsThatOnlyFillTheBox) {
  const auto image = blocks({39, 24, 36}, 7);
  SizingRule rule;
  rule.min_size = 2;
  const Execution execution(1);
  const auto sized = choose_lattice(image, {}, rule, execution);
  ASSERT_LT(sized.deepest_level, sized.pattern.finest_level());
  const auto levels = required_levels(image, sized, rule, execution);
  EXPECT_EQ(*std::max_element(levels.begin(), levels.end()), sized.deepest_level);
}

}  // namespace
}  // namespace treemarch
