// The proof of the bound: every undisplaced stencil of every shape that a lattice simplex can have.
#include "treemarch/march/quality_floor.h"

#include <gtest/gtest.h>

#include "treemarch/sizing/cubic_lattice.h"

namespace treemarch {
namespace {

TEST(quality_floor, uniform_lattice_keeps_30_degrees_for_any_order_of_the_keys) {
  const auto shapes = lattice_shapes<3>(false);
  EXPECT_EQ(shapes.size(), 12U);
  const StencilBound worst = worst_stencil<3>(shapes, false, {1, 1, 1});
  EXPECT_NEAR(worst.smallest_angle, 30.0, 1e-9);
  EXPECT_NEAR(worst.largest_angle, 144.7356, 1e-3);
}

TEST(quality_floor, trees_keep_18_degrees_with_long_edges_first) {
  const StencilBound worst = worst_stencil<3>(lattice_shapes<3>(true), true, {1, 1, 1});
  EXPECT_NEAR(worst.smallest_angle, 18.4349, 1e-3);
  EXPECT_NEAR(worst.largest_angle, 154.6482, 1e-3);
}

TEST(quality_floor, any_order_of_the_keys_on_trees_is_worse) {
  const StencilBound worst = worst_stencil<3>(lattice_shapes<3>(true), false, {1, 1, 1});
  EXPECT_NEAR(worst.smallest_angle, 15.8, 0.1);
  EXPECT_GT(worst.largest_angle, 154.6482);
}

TEST(quality_floor, stretched_cells_cost_as_much_as_promised) {
  for (const int axis : {0, 1, 2})
    for (const double factor : {kMostStretch, 1 / kMostStretch}) {
      Vec<3> sides{1, 1, 1};
      sides[axis] = factor;
      EXPECT_GE(guaranteed_quality<3>(sides), 18.0);
    }
  EXPECT_GE(guaranteed_quality<3>({1, std::sqrt(kMostStretch), kMostStretch}), 18.0);
  EXPECT_LT(guaranteed_quality<3>({1, 1, 1.24}), 15.5);
}

TEST(quality_floor, plane) {
  const StencilBound worst = worst_stencil<2>(lattice_shapes<2>(true), true, {1, 1});
  EXPECT_NEAR(worst.smallest_angle, 18.4349, 1e-3);
  EXPECT_NEAR(worst.largest_angle, 135.0, 1e-3);
  EXPECT_GE(guaranteed_quality<2>({1, kMostStretch}), 18.0);
}

}  // namespace
}  // namespace treemarch
