#include "treemarch/sizing/error_sizing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "support/images.h"
#include "treemarch/sizing/cubic_lattice.h"

namespace treemarch {
namespace {

using Levels = std::vector<std::uint8_t>;

template <int Dim>
Levels refined(const LabelImage<Dim>& image, double tolerance, int threads = 2, int last = -1) {
  const auto sized = choose_cubic_lattice(image, 1, 16);
  Levels levels(static_cast<std::size_t>(product(sized.lattice.extent)), 0);
  const Execution execution(threads);
  refine_by_error(image, UniformBlocks<Dim>(image, execution), sized, tolerance, last < 0 ? sized.deepest_level : last,
                  levels, execution);
  return levels;
}

std::int64_t sum(const Levels& levels) { return std::accumulate(levels.begin(), levels.end(), std::int64_t{0}); }

template <int Dim, class Label>
LabelImage<Dim> painted(const Coord<Dim>& extent, Label&& label) {
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) values.push_back(label(coord_of(i, extent)));
  return make_label_image<Dim>(extent, values);
}

TEST(ErrorSizing, LeavesWhatIsLinearCoarse) {
  EXPECT_EQ(sum(refined(painted<3>({48, 48, 48}, [](const Coord<3>& c) { return c[1] > 20; }), 0.01)), 0);
  EXPECT_EQ(sum(refined(painted<2>({64, 64}, [](const Coord<2>& c) { return 2 * c[0] + c[1] > 80; }), 1)), 0);
  EXPECT_EQ(sum(refined(painted<3>({32, 32, 32}, [](const Coord<3>&) { return 4; }), 0.01)), 0);
}

TEST(ErrorSizing, AsksForMoreWhereItIsLessTolerant) {
  const auto image = testing::ball_image<3>({48, 48, 48}, 0.3);
  Levels before = refined(image, 0.1);
  EXPECT_EQ(*std::ranges::max_element(before), 4);
  for (const double tolerance : {0.2, 0.6, 1.5}) {
    const Levels levels = refined(image, tolerance);
    EXPECT_LT(sum(levels), sum(before)) << tolerance;
    for (std::size_t i = 0; i < levels.size(); ++i) ASSERT_LE(levels[i], before[i]);
    before = levels;
  }
}

TEST(ErrorSizing, AsksNearInterfacesOnlyAndNotBeyondTheLastLevel) {
  const auto image = testing::ball_image<3>({64, 64, 64}, 0.4);
  const Levels levels = refined(image, 0.2);
  EXPECT_LE(levels[0], 1);
  EXPECT_LE(levels[linear_index<3>({32, 32, 32}, image.extent)], 1);
  const Levels limited = refined(image, 0.01, 2, 2);
  EXPECT_EQ(*std::ranges::max_element(limited), 2);
}

/// A grain is smaller than any tolerance of a large cell.
TEST(ErrorSizing, LosesNoPieceOfEightVoxels) {
  const auto in_grain = [](const Coord<3>& c) { return c[0] / 2 == 9 && c[1] / 2 == 8 && c[2] / 2 == 13; };
  const Levels levels = refined(painted<3>({48, 48, 48}, in_grain), 3);
  EXPECT_GE(levels[linear_index<3>({18, 16, 26}, {48, 48, 48})], 2);
}

TEST(ErrorSizing, KnowsNoThreadsLabelsOrSides) {
  auto image = testing::noise_image<3>({16, 16, 16}, 3, 5);
  const Coord<3> extent{32, 32, 32};
  const auto blob = [&](Coord<3> c) {
    for (int d = 0; d < 3; ++d) c[d] /= 2;
    return image.labels[image.material(c)];
  };
  const auto plain = painted<3>(extent, blob);
  const Levels levels = refined(plain, 0.4);
  EXPECT_EQ(refined(plain, 0.4, 1), levels);
  EXPECT_EQ(refined(plain, 0.4, 7), levels);
  auto renamed = plain;
  std::ranges::reverse(renamed.labels);
  EXPECT_EQ(refined(renamed, 0.4), levels);
  const auto mirrored = refined(painted<3>(extent,
                                           [&](Coord<3> c) {
                                             c[1] = extent[1] - 1 - c[1];
                                             return blob(c);
                                           }),
                                0.4);
  for (std::int64_t i = 0; i < product(extent); ++i) {
    Coord<3> c = coord_of(i, extent);
    c[1] = extent[1] - 1 - c[1];
    ASSERT_EQ(mirrored[i], levels[linear_index(c, extent)]);
  }
}

}  // namespace
}  // namespace treemarch
