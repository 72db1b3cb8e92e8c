#include "treemarch/march/solid_angle.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "march/march_meshes.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<double> sums(const Mesh<Dim>& mesh) {
  std::vector<double> sum(mesh.points.size(), 0.0);
  for (const CellBlock& block : mesh.blocks) {
    for (std::int64_t i = 0; i < block.size(); ++i) {
      for (int k = 0; k < vertex_count(block.type); ++k) {
        const double ratio = solid_angle_ratio<Dim>(block.type, block.cell(i), k, mesh.points);
        EXPECT_GT(ratio, 0);
        sum[block.cell(i)[k]] += ratio;
      }
    }
  }
  return sum;
}

/// 1 inside, 1/2 on a hull face, 1/4 on a hull edge (2D: corner), 1/8 on a corner.
template <int Dim>
double expected(const Vec<Dim>& x, const Vec<Dim>& size) {
  double share = 1;
  for (int d = 0; d < Dim; ++d) share *= x[d] == 0 || x[d] == size[d] ? 0.5 : 1.0;
  return share;
}

template <int Dim>
void expect_full(const Mesh<Dim>& mesh, const Vec<Dim>& size) {
  const auto sum = sums(mesh);
  for (std::size_t v = 0; v < sum.size(); ++v) EXPECT_NEAR(sum[v], expected(mesh.points[v], size), 1e-13);
}

TEST(SolidAngle, RatiosAroundEveryVertexAddUp) {
  auto triangles = testing::noise_mesh<2>(6, 2, 1);
  testing::jitter(triangles, 0.2, 6, 2);
  expect_full<2>(triangles, {6, 6});
  auto tetrahedra = testing::noise_mesh<3>(4, 2, 1);
  testing::jitter(tetrahedra, 0.15, 4, 3);
  expect_full<3>(tetrahedra, {4, 4, 4});
}

TEST(SolidAngle, AllTypesOfCells) {
  expect_full<3>(testing::mixed_mesh(), {1, 1, 2});
  Mesh<2> quads;
  quads.points = {{0, 0}, {1, 0}, {2, 0}, {0, 1}, {0.8, 0.7}, {2, 1}, {0, 2}, {1, 2}, {2, 2}};
  quads.blocks.push_back({CellType::quad, {0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7}, {0, 0, 0, 0}});
  expect_full<2>(quads, {2, 2});
}

TEST(SolidAngle, SplittingAConeKeepsIt) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0.1, 1);
  for (int i = 0; i < 100; ++i) {
    const Vec<3> a{1, 0.1 * u(random), 0};
    const Vec<3> b{0, 1, 0.3 * u(random)};
    const Vec<3> c{0.2 * u(random), 0, 1};
    const Vec<3> d = u(random) * a + u(random) * b;
    EXPECT_NEAR(cone_ratio(a, b, c), cone_ratio(a, d, c) + cone_ratio(d, b, c), 1e-14);
    EXPECT_NEAR(cone_ratio(a, c, b), -cone_ratio(a, b, c), 1e-14);
  }
}

}  // namespace
}  // namespace treemarch
