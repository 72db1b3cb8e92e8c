#include "treemarch/mesh/output_frame.h"

#include <gtest/gtest.h>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

Frame<3> scanner_frame() {
  Frame<3> frame;
  frame.spacing = {0.5, 2, 3};
  frame.direction = {Vec<3>{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, 1}};
  frame.origin = {7, -5, 11};
  frame.space = "LPS";
  return frame;
}

TEST(OutputFrame, TurnsAxesExactly) {
  const Frame<3> frame = scanner_frame();
  const Vec<3> x{1.25, 3, 4};
  const Vec<3> lps = to_world(frame, x);
  const Vec<3> ras = to_world(output_frame(frame, OutputSpace::ras), x);
  EXPECT_EQ(ras, (Vec<3>{-lps[0], -lps[1], lps[2]}));
  EXPECT_EQ(to_world(output_frame(frame, OutputSpace::lps), x), lps);
  EXPECT_EQ(to_world(output_frame(frame, OutputSpace::file), x), lps);
  EXPECT_EQ(output_frame(frame, OutputSpace::ras).space, "RAS");
}

TEST(OutputFrame, PermutesAxes) {
  Frame<3> frame = scanner_frame();
  frame.space = "PIR";
  const Vec<3> x{1, 2, 3};
  const Vec<3> pir = to_world(frame, x);
  EXPECT_EQ(to_world(output_frame(frame, OutputSpace::ras), x), (Vec<3>{pir[2], -pir[0], -pir[1]}));
}

TEST(OutputFrame, JudgesHandednessAfterTheTurn) {
  Frame<3> frame = scanner_frame();
  EXPECT_FALSE(is_left_handed(frame));
  EXPECT_FALSE(is_left_handed(output_frame(frame, OutputSpace::ras)));
  frame.space = "LAS";
  EXPECT_TRUE(is_left_handed(output_frame(frame, OutputSpace::ras)));
  std::swap(frame.direction[0], frame.direction[1]);
  EXPECT_TRUE(is_left_handed(frame));
  EXPECT_FALSE(is_left_handed(output_frame(frame, OutputSpace::ras)));
  EXPECT_FALSE(is_left_handed(output_frame(frame, OutputSpace::index)));
}

TEST(OutputFrame, IndexPutsVoxelCentresAtIntegers) {
  const Frame<3> index = output_frame(scanner_frame(), OutputSpace::index);
  const Vec<3> w = to_world(index, {0.5 * 4.5, 2 * 0.5, 3 * 10.0});
  EXPECT_NEAR(w[0], 4, 1e-12);
  EXPECT_NEAR(w[1], 0, 1e-12);
  EXPECT_NEAR(w[2], 9.5, 1e-12);
}

TEST(OutputFrame, NeedsAxesThatAreNamed) {
  for (const char* space : {"", "LP", "XYZ", "LPP"}) {
    Frame<3> frame = scanner_frame();
    frame.space = space;
    EXPECT_THROW(output_frame(frame, OutputSpace::ras), Error) << space;
    EXPECT_NO_THROW(output_frame(frame, OutputSpace::index));
  }
}

}  // namespace
}  // namespace treemarch
