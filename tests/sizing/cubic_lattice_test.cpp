#include "treemarch/sizing/cubic_lattice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/images.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// An image of cubic voxels, `least` to `least` + 199 along each axis.
LabelImage<3> random_cubes(std::mt19937& random, std::int32_t least) {
  LabelImage<3> image;
  for (int d = 0; d < 3; ++d) {
    image.extent[d] = least + static_cast<std::int32_t>(random() % 200);
    image.frame.spacing[d] = 1;
  }
  return image;
}

template <int Dim>
void check_random_lattices(unsigned seed) {
  std::mt19937 random(seed);
  for (int round = 0; round < 300; ++round) {
    LabelImage<Dim> image;
    for (int d = 0; d < Dim; ++d) {
      image.extent[d] = 1 + static_cast<std::int32_t>(random() % 300);
      image.frame.spacing[d] = 0.25 * static_cast<double>(1 + random() % 12);
    }
    const double smallest = 0.1 * static_cast<double>(5 + random() % 100), largest = smallest * (1 + random() % 20);
    const auto sized = choose_cubic_lattice(image, smallest, largest);
    SCOPED_TRACE(::testing::Message() << "round " << round << " smallest " << smallest << " largest " << largest);

    const Vec<Dim> box = image.size();
    double side = 0, shortest = 1e9;
    for (int d = 0; d < Dim; ++d) {
      EXPECT_NEAR(sized.lattice.extent[d] * sized.lattice.unit[d], box[d], 1e-9 * box[d]);
      side = std::max(side, sized.lattice.unit[d]);
      shortest = std::min(shortest, sized.lattice.unit[d]);
    }
    EXPECT_DOUBLE_EQ(stretch(sized.lattice), side / shortest);
    // Not above the size asked for, where the box has room for several cells of it.
    if (std::ranges::all_of(box, [&](double b) { return b >= 2 * smallest; })) {
      EXPECT_LE(side, smallest * 1.35);
      EXPECT_GE(side, smallest * 0.6);
    }
    // At least one level; none but the first makes cells larger than the largest size.
    EXPECT_GE(sized.deepest_level, 1);
    EXPECT_EQ(sized.deepest_level, sized.pattern.finest_level());
    if (sized.deepest_level > 1) {
      EXPECT_LE(sized.pattern.cell_extent(0)[0] * side, largest * (1 + 1e-4));
    }
    for (const Coord<Dim>& factor : sized.pattern.factors)
      for (const std::int32_t f : factor) EXPECT_EQ(f, 2);
  }
}

TEST(CubicLattice, FillsTheBoxWithCellsOfAboutTheSize) {
  check_random_lattices<2>(1);
  check_random_lattices<3>(2);
}

TEST(CubicLattice, IsNearlyCubicWhereTheBoxHasRoom) {
  std::mt19937 random(3);
  for (int round = 0; round < 100; ++round) {
    EXPECT_LE(stretch(choose_cubic_lattice(random_cubes(random, 60), 1.7, 16).lattice), kMostStretch);
  }
}

TEST(CubicLattice, PutsNoLayerOfSmallestCellsOntoTheSidesOfTheBox) {
  std::mt19937 random(4);
  for (int round = 0; round < 100; ++round) {
    const LabelImage<3> image = random_cubes(random, 160);
    const auto lattice = choose_cubic_lattice(image, 1.1 + 0.01 * static_cast<double>(random() % 80), 16).lattice;
    for (const std::int32_t cells : lattice.extent) EXPECT_EQ(cells % 2, 0);
    EXPECT_LE(stretch(lattice), kMostStretch);
  }
}

TEST(CubicLattice, RefusesMoreCellsThanCoordinatesCount) {
  LabelImage<2> image;
  image.extent = {100, 1};
  image.frame.spacing = {1, 1};
  EXPECT_THROW(choose_cubic_lattice(image, 1e-7, 1), Error);
  image.extent = {2'000'000'000, 1'000'000'000};
  const auto lattice = choose_cubic_lattice(image, 1000, 16'000).lattice;
  EXPECT_EQ(lattice.extent, (Coord<2>{2'000'000, 1'000'000}));
}

TEST(CubicLattice, TakesWholeVoxelsWhereTheyFit) {
  LabelImage<3> image;
  image.extent = {24, 36, 60};
  image.frame.spacing = {0.7, 0.7, 0.7};
  for (const int side : {1, 2, 3, 4, 6}) {
    const auto lattice = choose_cubic_lattice(image, 0.7 * side, 100).lattice;
    for (int d = 0; d < 3; ++d) EXPECT_EQ(lattice.extent[d], image.extent[d] / side) << side;
  }
}

}  // namespace
}  // namespace treemarch
