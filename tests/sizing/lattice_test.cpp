#include "treemarch/sizing/lattice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// The choice needs no voxels.
template <int Dim>
LabelImage<Dim> blank(const Coord<Dim>& extent, const Vec<Dim>& spacing) {
  LabelImage<Dim> image;
  image.extent = extent;
  image.frame.spacing = spacing;
  return image;
}

template <int Dim>
Vec<Dim> sides(const SizedLattice<Dim>& sized, int level) {
  Vec<Dim> s{};
  for (int d = 0; d < Dim; ++d) s[d] = sized.pattern.cell_extent(level)[d] * sized.lattice.unit[d];
  return s;
}

template <int Dim>
double longest(const Vec<Dim>& s) {
  return *std::max_element(s.begin(), s.end());
}

template <int Dim>
double aspect(const Vec<Dim>& s) {
  return longest(s) / *std::min_element(s.begin(), s.end());
}

TEST(Pattern, ReadsEveryForm) {
  EXPECT_TRUE(parse_pattern<3>("auto").empty());
  EXPECT_THAT(parse_pattern<3>("2"), ::testing::ElementsAre(Coord<3>{2, 2, 2}));
  EXPECT_THAT(parse_pattern<3>("2x2x1"), ::testing::ElementsAre(Coord<3>{2, 2, 1}));
  EXPECT_THAT(parse_pattern<3>("3,2,2x2x1"),
              ::testing::ElementsAre(Coord<3>{3, 3, 3}, Coord<3>{2, 2, 2}, Coord<3>{2, 2, 1}));
  EXPECT_THAT(parse_pattern<2>("1x64"), ::testing::ElementsAre(Coord<2>{1, 64}));
}

TEST(Pattern, RefusesTheRest) {
  for (const char* text : {"", "1", "0", "65", "-2", "2x2", "2x2x2x2", "1x1x1", "2,", ",2", "2 ", "2xx2", "x", "2,1",
                           "a", "AUTO", "99999999999"}) {
    try {
      parse_pattern<3>(text);
      ADD_FAILURE() << text;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::usage);
      EXPECT_THAT(e.what(), ::testing::StartsWith("--pattern: "));
    }
  }
}

/// Whatever is asked for, the lattice fills the box, and levels and sizes fit together.
TEST(ChooseLattice, FillsTheBoxWithTheSizesAskedFor) {
  std::mt19937 random(11);
  const Execution execution(1);
  const auto pick = [&](auto... values) {
    const std::array list{values...};
    return list[random() % list.size()];
  };
  for (int i = 0; i < 2000; ++i) {
    Coord<3> extent{};
    for (auto& e : extent) e = static_cast<std::int32_t>(1 + random() % 200);
    const double s = pick(0.25, 1.0, 3.0);
    const auto image = blank<3>(extent, {s, s * pick(1.0, 1.0, 1.5), s * pick(1.0, 1.3, 6.0)});
    SizingRule rule;
    rule.min_size = s * pick(0.0, 0.5, 1.0, 2.0, 2.7, 4.0, 6.0, 9.0);
    rule.max_size = s * pick(0.0, 16.0, 40.0);
    const std::string text = pick("auto", "2", "3", "2x2x1", "3,2", "2x1x1,2,5");
    SCOPED_TRACE(::testing::PrintToString(extent) + " " + ::testing::PrintToString(image.frame.spacing) + " " + text +
                 " " + std::to_string(rule.min_size));
    const auto sized = choose_lattice(image, parse_pattern<3>(text), rule, execution);
    const double smallest = std::max(rule.min_size, s);
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(sized.lattice.extent[d] * sized.lattice.unit[d], image.size()[d], 1e-9 * image.size()[d]);
      const double spacing = image.frame.spacing[d];
      const double voxels = sized.lattice.unit[d] / spacing;
      if (text != "auto" || aspect(image.frame.spacing) < 2) {
        EXPECT_NEAR(voxels, std::round(voxels), 1e-9);
        EXPECT_LE(sides(sized, sized.deepest_level)[d], std::max(smallest, spacing) * (1 + 1e-9));
        EXPECT_GT(sides(sized, sized.deepest_level)[d], std::min(smallest, image.size()[d]) - spacing - 1e-9);
      }
      // A finest cell never straddles the box, and levels beyond the smallest size are there only when they must.
      if (sized.deepest_level < sized.pattern.finest_level() && sized.pattern.factors.back()[d] > 1) {
        const auto cell = sized.pattern.cell_extent(sized.pattern.finest_level() - 1)[d];
        EXPECT_NE(sized.lattice.extent[d] % cell, 0);
      }
    }
    if (text.find(',') == std::string::npos && sized.deepest_level > 0) {
      const double max = rule.max_size > 0 ? rule.max_size : 8 * longest(sides(sized, sized.deepest_level));
      EXPECT_LE(longest(sides(sized, 0)), max * (1 + 1e-9));
    }
  }
}

TEST(ChooseLattice, RootsOfSixteen) {
  SizingRule rule;
  rule.max_size = 16;
  const auto sized = choose_lattice(blank<3>({256, 256, 256}, {1, 1, 1}), {}, rule, Execution(1));
  EXPECT_EQ(sized.pattern.factors, std::vector<Coord<3>>(4, Coord<3>{2, 2, 2}));
  EXPECT_EQ(sized.deepest_level, 4);
}

TEST(ChooseLattice, AutomaticPatternIsNearIsotropicForThickSlices) {
  const Execution execution(1);
  std::vector<LabelImage<3>> images{blank<3>({82, 67, 13}, {0.5, 0.5, 3})};  // the prostate phantom
  std::mt19937 random(3);
  for (int i = 0; i < 500; ++i) {
    Coord<3> extent{};
    Vec<3> spacing{};
    for (int d = 0; d < 3; ++d) {
      spacing[d] = 0.2 + 0.01 * static_cast<double>(random() % 500);
      extent[d] = static_cast<std::int32_t>(200 / spacing[d]);  // many cells an axis
    }
    if (aspect(spacing) >= 2) images.push_back(blank(extent, spacing));
  }
  for (const auto& image : images) {
    for (const double size : {0.0, 1.0, 2.5, 4.0}) {
      SizingRule rule;
      rule.min_size = size;
      const auto sized = choose_lattice(image, {}, rule, execution);
      for (int l = 0; l <= sized.pattern.finest_level(); ++l)
        EXPECT_LT(aspect(sides(sized, l)), 2.0) << ::testing::PrintToString(image.frame.spacing) << " " << size;
    }
  }
}

TEST(ChooseLattice, SmallestCellFollowsTheFinestRule) {
  const auto image = blank<2>({64, 64}, {1, 1});
  std::vector<SizingRule> rules(4);
  for (auto& rule : rules) rule.min_size = 4;
  rules[1].material_size = {0, 2};
  rules[2].material_interface_size = {0, 2};
  rules[3].interface_size = {{0, 1, 2}};
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const auto sized = choose_lattice(image, {}, rules[i], Execution(1));
    EXPECT_EQ(longest(sides(sized, sized.deepest_level)), i == 0 ? 4 : 2) << i;
  }
}

TEST(ChooseLattice, SaysWhenASizeIsRounded) {
  Execution execution(1);
  std::vector<std::string> warnings;
  execution.on_warning = [&](std::string_view w) { warnings.emplace_back(w); };
  SizingRule rule;
  rule.min_size = 2;
  const auto image = blank<2>({30, 30}, {1, 1});
  choose_lattice(image, {}, rule, execution);
  EXPECT_TRUE(warnings.empty());
  rule.min_size = 2.5;
  choose_lattice(image, {}, rule, execution);
  EXPECT_THAT(warnings, ::testing::ElementsAre(::testing::HasSubstr("2.5 becomes cells of 2 x 2")));
}

TEST(ChooseLattice, RefusesSizesThatCannotBe) {
  const auto image = blank<2>({30, 30}, {1, 1});
  const Execution execution(1);
  const auto expect_error = [&](const SizingRule& rule, const char* option) {
    try {
      choose_lattice(image, {}, rule, execution);
      ADD_FAILURE() << option;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::usage);
      EXPECT_THAT(e.what(), ::testing::StartsWith(option));
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_error({.min_size = 3, .max_size = 2, .material_size = {}, .interface_size = {}}, "--min-size: ");
  expect_error({.min_size = -1, .max_size = 0, .material_size = {}, .interface_size = {}}, "--min-size: ");
  expect_error({.min_size = 0, .max_size = nan, .material_size = {}, .interface_size = {}}, "--max-size: ");
  expect_error({.min_size = 0, .max_size = 8, .material_size = {9}, .interface_size = {}}, "--size: ");
  expect_error({.min_size = 0, .max_size = 8, .material_size = {}, .interface_size = {{0, 0, nan}}}, "--interface: ");
  EXPECT_THROW(choose_lattice(image, parse_pattern<2>("64,64,64,64,64,64"), {}, execution), Error);
}

}  // namespace
}  // namespace treemarch
