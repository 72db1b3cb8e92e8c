#include "treemarch/mesh/raster.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

namespace treemarch {
namespace {

constexpr Colour kRed{1, 0, 0}, kBlue{0, 0, 1};

ScreenTriangle triangle(std::array<std::array<float, 3>, 3> corner, const Colour& colour) {
  return {corner, {false, false, false}, colour};
}

TEST(Raster, TrianglesOfAMeshLeaveNoGap) {
  // A fan around an inner point covers its rectangle pixel by pixel.
  const std::array<std::array<float, 3>, 4> rim{{{10, 10, 0}, {110, 10, 0}, {110, 80, 0}, {10, 80, 0}}};
  std::vector<ScreenTriangle> fan;
  for (int i = 0; i < 4; ++i) fan.push_back(triangle({rim[i], rim[(i + 1) % 4], {47.3F, 31.7F, 0}}, kRed));
  const Raster raster = rasterise(fan, 120, 90, 1, Execution(2));
  int covered = 0;
  for (const float d : raster.depth) covered += d != Raster::kNothing;
  EXPECT_EQ(covered, 100 * 70);
}

TEST(Raster, NearestWinsInAnyOrder) {
  const ScreenTriangle near = triangle({{{0, 0, 5}, {40, 0, 5}, {0, 40, 5}}}, kRed);
  const ScreenTriangle far = triangle({{{0, 0, 1}, {40, 0, 1}, {0, 40, 1}}}, kBlue);
  for (const auto& order : {std::array{near, far}, std::array{far, near}}) {
    const Raster raster = rasterise(order, 64, 64, 1, Execution(1));
    EXPECT_EQ(raster.colour[5 * 64 + 5], kRed);
    EXPECT_EQ(raster.depth[5 * 64 + 5], 5);
    EXPECT_EQ(raster.depth[60 * 64 + 60], Raster::kNothing);
  }
}

TEST(Raster, DepthIsThatOfThePlane) {
  const auto raster =
      rasterise(std::array{triangle({{{0, 0, 0}, {100, 0, 100}, {0, 100, 200}}}, kRed)}, 100, 100, 1, Execution(1));
  EXPECT_NEAR(raster.depth[20 * 100 + 30], 30.5 + 2 * 20.5, 1e-3);
}

TEST(Raster, DrawsOnlyTheEdgesAskedFor) {
  ScreenTriangle t = triangle({{{10, 10, 0}, {90, 10, 0}, {10, 90, 0}}}, kRed);
  t.edge = {false, false, true};  // opposite of the third corner: the upper one
  const Raster raster = rasterise(std::array{t}, 100, 100, 1.5F, Execution(1));
  EXPECT_LT(raster.colour[10 * 100 + 40][0], 0.5F);
  EXPECT_EQ(raster.colour[40 * 100 + 10], kRed);
  EXPECT_EQ(raster.colour[30 * 100 + 30], kRed);
}

TEST(Raster, IsTheSameForAnyNumberOfThreadsAndSurvivesWildTriangles) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> anywhere(-100, 300);
  std::vector<ScreenTriangle> triangles;
  for (int i = 0; i < 500; ++i) {
    ScreenTriangle t;
    for (auto& c : t.corner)
      for (float& x : c) x = anywhere(random);
    if (i % 10 == 0) t.corner[2] = t.corner[1];
    t.colour = label_colour(i);
    triangles.push_back(t);
  }
  const Raster a = rasterise(triangles, 200, 150, 1, Execution(1));
  const Raster b = rasterise(triangles, 200, 150, 1, Execution(3));
  EXPECT_EQ(a.colour, b.colour);
  EXPECT_EQ(a.depth, b.depth);
}

TEST(Raster, HollowsGetDarkerAndHillsDoNot) {
  Raster raster{60, 60, std::vector<Colour>(3600, Colour{0.5F, 0.5F, 0.5F}), std::vector<float>(3600, 10)};
  raster.depth[30 * 60 + 15] = 0;   // a hole
  raster.depth[30 * 60 + 45] = 20;  // a spike
  darken_hollows(raster, 3, 5, Execution(2));
  EXPECT_LT(raster.colour[30 * 60 + 15][0], 0.3F);
  EXPECT_FLOAT_EQ(raster.colour[30 * 60 + 45][0], 0.5F);
  EXPECT_NEAR(raster.colour[5 * 60 + 30][0], 0.5F, 1e-3);
}

TEST(LabelColour, NeighboursDiffer) {
  for (std::int32_t label = -300; label < 300; ++label)
    for (std::int32_t other = label + 1; other < label + 6; ++other) {
      const Colour a = label_colour(label), b = label_colour(other);
      EXPECT_GT(std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), 0.05F) << label << " " << other;
    }
}

}  // namespace
}  // namespace treemarch
