#include "treemarch/mesh/interfaces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "support/meshes.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::mixed_mesh;

/// Area vector of a facet (length vector in 2D) by the documented orientation: along its normal.
Vec<3> area(const Mesh<3>& mesh, const FacetBlock& block, std::int64_t i) {
  const int n = vertex_count(block.type);
  Vec<3> sum{};
  for (int k = 2; k < n; ++k) {
    const Vec<3>& a = mesh.points[block.vertices[i * n]];
    sum = sum + 0.5 * cross(mesh.points[block.vertices[i * n + k - 1]] - a, mesh.points[block.vertices[i * n + k]] - a);
  }
  return sum;
}

Vec<2> area(const Mesh<2>& mesh, const FacetBlock& block, std::int64_t i) {
  const Vec<2> e = mesh.points[block.vertices[2 * i + 1]] - mesh.points[block.vertices[2 * i]];
  return {e[1], -e[0]};
}

/// Total area vector and absolute area for each pair of labels, -1000 for the outside.
template <int Dim>
std::map<std::pair<int, int>, std::pair<Vec<Dim>, double>> areas(const Mesh<Dim>& mesh, Hull hull) {
  std::map<std::pair<int, int>, std::pair<Vec<Dim>, double>> sums;
  for (const FacetBlock& block : extract_interfaces(mesh, hull, Execution(2)))
    for (std::int64_t i = 0; i < block.size(); ++i) {
      const int first = mesh.labels[block.first[i]];
      const int second = block.second[i] == kOutside ? -1000 : mesh.labels[block.second[i]];
      EXPECT_TRUE(second == -1000 || first < second);
      auto& sum = sums[{first, second}];
      const Vec<Dim> a = area(mesh, block, i);
      sum.first = sum.first + a;
      sum.second += norm(a);
    }
  return sums;
}

TEST(Interfaces, OfSlabsAreFlatAndFaceTheLargerLabel) {
  // Labels fall along x, so that the smaller label of a pair lies on the upper side.
  const Mesh<3> mesh = box_mesh<3>({3, 2, 2}, [](const Coord<3>& c) { return 10 - c[0]; }, {1, 2, 3});
  const auto sums = areas(mesh, Hull::leave_out);
  ASSERT_EQ(sums.size(), 2U);
  for (const auto& pair : {std::pair{8, 9}, std::pair{9, 10}}) {
    const auto& [vector, total] = sums.at(pair);
    EXPECT_DOUBLE_EQ(vector[0], -24);
    EXPECT_DOUBLE_EQ(total, 24);
  }
}

TEST(Interfaces, AreClosedWithTheHull) {
  // By the divergence theorem the area vectors around each material sum to zero.
  auto label = [](const Coord<3>& c) { return (c[0] * 7 + c[1] * 5 + c[2] * 3) % 4 - 1; };
  const Mesh<3> mesh = box_mesh<3>({6, 5, 4}, label);
  std::map<int, Vec<3>> around;
  double hull = 0;
  for (const auto& [pair, sum] : areas(mesh, Hull::include)) {
    around[pair.first] = around[pair.first] + sum.first;
    if (pair.second != -1000) around[pair.second] = around[pair.second] - sum.first;
    if (pair.second == -1000) hull += sum.second;
  }
  EXPECT_EQ(around.size(), 4U);
  for (const auto& [value, sum] : around) EXPECT_NEAR(norm(sum), 0, 1e-9) << value;
  EXPECT_NEAR(hull, 2 * (30 + 24 + 20), 1e-9);
}

TEST(Interfaces, OfTwoDimensions) {
  const Mesh<2> mesh = box_mesh<2>({4, 3}, [](const Coord<2>& c) { return c[0] == 1 && c[1] == 1 ? 5 : 2; });
  const auto sums = areas(mesh, Hull::include);
  ASSERT_EQ(sums.size(), 2U);
  EXPECT_NEAR((sums.at({2, 5}).second), 4, 1e-12);
  EXPECT_NEAR((sums.at({2, -1000}).second), 14, 1e-12);
  for (const FacetBlock& b : extract_interfaces(mesh, Hull::leave_out, Execution(1)))
    for (std::int64_t i = 0; i < b.size(); ++i) {  // towards 5, whose centre is (1.5, 1.5)
      const Vec<2> a = area(mesh, b, i);
      EXPECT_GT(dot(a, Vec<2>{1.5, 1.5} - mesh.points[b.vertices[2 * i]]), 0);
    }
}

TEST(Interfaces, OfMixedCells) {
  const auto blocks = extract_interfaces(mixed_mesh(), Hull::include, Execution(1));
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[0].type, CellType::triangle);
  EXPECT_EQ(blocks[1].type, CellType::quad);
  EXPECT_EQ(std::count(blocks[1].second.begin(), blocks[1].second.end(), kOutside), 5 + 2);
  EXPECT_EQ(blocks[1].size(), 5 + 2 + 1);
}

TEST(Interfaces, DoNotDependOnThreads) {
  const Mesh<3> mesh = box_mesh<3>({40, 20, 20}, [](const Coord<3>& c) { return (c[0] / 3 + c[1] / 2 + c[2]) % 5; });
  const auto a = extract_interfaces(mesh, Hull::include, Execution(1));
  const auto b = extract_interfaces(mesh, Hull::include, Execution(3));
  ASSERT_EQ(a.size(), 1U);
  EXPECT_EQ(a[0].vertices, b[0].vertices);
  EXPECT_EQ(a[0].first, b[0].first);
  EXPECT_EQ(a[0].second, b[0].second);
}

}  // namespace
}  // namespace treemarch
