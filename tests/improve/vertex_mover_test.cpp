#include "treemarch/improve/vertex_mover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "improve/improve_meshes.h"
#include "treemarch/improve/stratum.h"

namespace treemarch {
namespace {

template <int Dim>
void check_moves(const LabelImage<Dim>& image) {
  auto cut = testing::cut_image(image);
  const std::vector<VertexId> all = testing::all_vertices(cut.mesh);
  Execution execution(2);
  Patch<Dim> patch(cut.mesh, all, execution);
  const MoveLimits limits{.displacement = 0.1, .slack = 0.1, .goal = 60, .inner_reach = 0.5, .reach = 0.25};
  int moved[4] = {}, far = 0;
  for (const VertexId v : all) {
    const Vec<Dim> start = patch.point(v);
    const Stratum stratum = stratum_of(patch, v, cut.box, cut.field);
    EXPECT_FALSE(stratum.open);
    EXPECT_EQ(stratum.fixed_axes, box_axes(start, cut.box));
    const Constraint<Dim> constraint(cut.field, stratum, start);
    for (const bool loose : {false, true}) {
      const double before = star_quality(patch, v);
      Vec<Dim> x;
      if (!find_better_place(patch, v, cut.field, cut.box, limits, loose, start, x)) continue;
      for (int d = 0; d < Dim; ++d)
        if (stratum.fixed_axes >> d & 1) {
          EXPECT_EQ(x[d], start[d]);
        }
      double shortest = 1e9;
      for (const CellId c : patch.star(v))
        for (const VertexId w : patch.cell(c))
          if (w != v) shortest = std::min(shortest, norm(patch.point(w) - start));
      const double reach = shortest * (stratum.count == 1 ? limits.inner_reach : limits.reach);
      EXPECT_LE(norm(x - start), std::max(limits.displacement, reach));
      far += norm(x - start) > limits.displacement;
      if (stratum.count > 1 && constraint.known()) {
        EXPECT_LE(norm(constraint.to_stratum(x)), std::max(norm(constraint.to_stratum(start)), limits.slack) + 1e-6);
      }
      if (stratum.count > 1 && !constraint.known()) {
        EXPECT_LE(norm(x - start), limits.slack);
      }
      patch.move(v, x);
      EXPECT_GT(star_quality(patch, v), before);
      patch.move(v, start);
      ++moved[std::min(stratum.count, 4) - 1];
    }
  }
  EXPECT_GT(moved[0], 10);
  EXPECT_GT(moved[1], 10);
  EXPECT_GT(moved[2], 1);
  EXPECT_GT(far, 10);
}

TEST(FindBetterPlace, RaisesTheWorstWithinTheStratum2D) { check_moves(testing::mixed_image<2>({20, 17}, 4, 0.05, 1)); }
TEST(FindBetterPlace, RaisesTheWorstWithinTheStratum3D) { check_moves(testing::mixed_image<3>({8, 8, 7}, 4, 0.02, 2)); }

TEST(FindNearerPlace, NeverAtThePriceOfTheGoal) {
  auto cut = testing::cut_image(testing::mixed_image<3>({9, 9, 9}, 4, 0.05, 3));
  const std::vector<VertexId> all = testing::all_vertices(cut.mesh);
  Execution execution(2);
  Patch<3> patch(cut.mesh, all, execution);
  const MoveLimits limits{0.5, 0.01, 20};
  int moved = 0;
  for (const VertexId v : all) {
    const Vec<3> here = patch.point(v);
    const double before = star_quality(patch, v);
    const Stratum stratum = stratum_of(patch, v, cut.box, cut.field);
    const Constraint<3> constraint(cut.field, stratum, here);
    Vec<3> x;
    if (!find_nearer_place(patch, v, cut.field, cut.box, limits, here, x)) continue;
    EXPECT_GE(stratum.count, 2);
    EXPECT_LT(norm(constraint.to_stratum(x)), norm(constraint.to_stratum(here)));
    EXPECT_LE(norm(x - here), limits.displacement);
    patch.move(v, x);
    EXPECT_EQ(box_axes(x, cut.box) & stratum.fixed_axes, stratum.fixed_axes);
    EXPECT_GE(star_quality(patch, v), std::min(before, limits.goal) - 1e-6);
    ++moved;
  }
  EXPECT_GT(moved, 5);
}

TEST(Stratum, KeepsMaterialsAscendingAndOnce) {
  Stratum s;
  for (const MaterialId m : {5U, 1U, 5U, 9U, 1U, 0U}) s.add(m);
  EXPECT_EQ(std::vector<MaterialId>(s.materials().begin(), s.materials().end()), (std::vector<MaterialId>{0, 1, 5, 9}));
  for (MaterialId m = 20; m < 40; ++m) s.add(m);
  EXPECT_EQ(s.count, Stratum::kMost);
}

}  // namespace
}  // namespace treemarch
