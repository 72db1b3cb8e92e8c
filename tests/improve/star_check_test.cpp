#include "treemarch/improve/star_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "improve/improve_meshes.h"

namespace treemarch {
namespace {

/// Cells one by one, at many places of a vertex: some where all cells are good, some where they are not.
template <int Dim>
void check_stars(const LabelImage<Dim>& image) {
  auto cut = testing::cut_image(image);
  const std::vector<VertexId> all = testing::all_vertices(cut.mesh);
  const Patch<Dim> patch(cut.mesh, all, Execution(2));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> some(-0.3, 0.3);
  StarCheck<Dim> check;
  int good = 0, bad = 0;
  for (const VertexId v : all) {
    std::vector<std::array<VertexId, Dim>> cells;
    for (const CellId c : patch.star(v)) {
      cells.push_back(others_of<Dim>(patch.cell(c), v));
      std::array<Vec<Dim>, Dim> edges;
      for (int k = 0; k < Dim; ++k) edges[k] = patch.point(cells.back()[k]) - patch.point(v);
      EXPECT_GT(determinant<Dim>(edges), 0);
    }
    check.gather(cut.mesh.points, cells);
    const auto [low, high] = check.bounds();
    for (int d = 0; d < Dim; ++d) {
      double least = 1e9, most = -1e9;
      for (const auto& cell : cells)
        for (const VertexId w : cell) {
          least = std::min(least, patch.point(w)[d]);
          most = std::max(most, patch.point(w)[d]);
        }
      EXPECT_EQ(low[d], least);
      EXPECT_EQ(high[d], most);
    }
    for (int trial = 0; trial < 8; ++trial) {
      const SquaredQualityBound bound(QualityBound(5 + 5 * (trial % 4)));
      Vec<Dim> x = patch.point(v);
      for (int d = 0; d < Dim && trial > 0; ++d) x[d] += some(random);
      std::vector<std::size_t> expected, found;
      for (std::size_t i = 0; i < cells.size(); ++i) {
        const SimplexVertices<Dim> cell = patch.cell(patch.star(v)[i]);
        std::array<Vec<Dim>, Dim + 1> p;
        for (int k = 0; k <= Dim; ++k) p[k] = cell[k] == v ? x : patch.point(cell[k]);
        if (!meets(p, bound)) expected.push_back(i);
      }
      check.visit_failing(x, bound, [&](std::size_t i) { found.push_back(i); });
      EXPECT_EQ(found, expected) << "vertex " << v << " trial " << trial;
      EXPECT_EQ(check.all_meet(x, bound), expected.empty()) << "vertex " << v << " trial " << trial;
      ++(expected.empty() ? good : bad);
    }
  }
  EXPECT_GT(good, 100);
  EXPECT_GT(bad, 100);
}

TEST(StarCheck, SaysOfAllCellsWhatTheySayOneByOne2D) { check_stars(testing::mixed_image<2>({20, 17}, 4, 0.05, 1)); }
TEST(StarCheck, SaysOfAllCellsWhatTheySayOneByOne3D) { check_stars(testing::mixed_image<3>({8, 8, 7}, 4, 0.02, 2)); }

}  // namespace
}  // namespace treemarch
