#include "treemarch/improve/flips.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "improve/improve_meshes.h"

namespace treemarch {
namespace {

struct Configuration {
  Mesh<3> mesh;

  Configuration() {
    mesh.blocks.resize(1);
    mesh.blocks[0].type = CellType::tetrahedron;
    mesh.labels = {1, 2, 3};
  }
  void add(SimplexVertices<3> v, MaterialId material = 0) {
    const Vec<3>& p = mesh.points[v[0]];
    if (dot(cross(mesh.points[v[1]] - p, mesh.points[v[2]] - p), mesh.points[v[3]] - p) < 0) std::swap(v[0], v[1]);
    mesh.blocks[0].vertices.insert(mesh.blocks[0].vertices.end(), v.begin(), v.end());
    mesh.blocks[0].materials.push_back(material);
  }
  Patch<3> patch() { return {mesh, testing::all_vertices(mesh), Execution(1)}; }
  void compact_after(const Patch<3>& patch) {
    const Execution execution(1);
    Removed removed;
    patch.list_removed(removed);
    compact(mesh, removed, execution);
  }
};

/// A ring of n cells around the edge 0-1, wide and flat along it so that the edge is better away. `open`: the last cell
/// is missing and the ends lie on x = 0. `bend` lifts every rim vertex on one side.
Configuration ring(int n, bool open, unsigned seed, double height, double bend = 0) {
  std::mt19937 random(seed);
  const auto jitter = [&] { return 0.1 * (static_cast<double>(random() % 1000) / 1000 - 0.5); };
  Configuration c;
  c.mesh.points = {{0, 0, -height}, {0, 0, height}};
  for (int i = 0; i < n + (open ? 1 : 0); ++i) {
    const double angle = open ? std::numbers::pi * (static_cast<double>(i) / n - 0.5) : 2 * std::numbers::pi * i / n;
    Vec<3> p{std::cos(angle), std::sin(angle), jitter()};
    if (open && (i == 0 || i == n)) p[0] = 0;
    p[0] += bend * std::abs(p[1]);
    c.mesh.points.push_back(p);
  }
  for (int i = 0; i < n; ++i)
    c.add({0, 1, static_cast<VertexId>(2 + i), static_cast<VertexId>(2 + (open ? i + 1 : (i + 1) % n))});
  return c;
}

TEST(FlipFacet, HappensExactlyWhereItHelps) {
  int done = 0;
  for (int k = 1; k < 40; ++k) {
    Configuration c;
    const double h = 0.04 * k;
    c.mesh.points = {{0, 0, 0}, {1, 0, 0}, {0.4, 0.9, 0}, {0.45, 0.3, h}, {0.5, 0.3, -h}};
    c.add({0, 1, 2, 3});
    c.add({0, 1, 2, 4});
    const double before = testing::worst_quality(c.mesh), volume = testing::volumes(c.mesh)[0];
    Patch<3> patch = c.patch();
    const SimplexVertices<3> v = patch.cell(0);
    const int corner = static_cast<int>(std::ranges::find(v, 3U) - v.begin());
    const bool flipped = flip_facet(patch, 0, corner);
    EXPECT_EQ(c.mesh.blocks[0].size(), flipped ? 3 : 2);
    EXPECT_NEAR(testing::volumes(c.mesh)[0], volume, 1e-12);
    if (flipped)
      EXPECT_GT(testing::worst_quality(c.mesh), before);
    else
      EXPECT_EQ(testing::worst_quality(c.mesh), before);
    done += flipped;
  }
  EXPECT_GT(done, 5);
  EXPECT_LT(done, 39);
}

TEST(FlipFacet, KeepsInterfaces) {
  Configuration c;
  c.mesh.points = {{0, 0, 0}, {1, 0, 0}, {0.4, 0.9, 0}, {0.45, 0.3, 0.1}, {0.5, 0.3, -0.1}};
  c.add({0, 1, 2, 3}, 0);
  c.add({0, 1, 2, 4}, 1);
  Patch<3> patch = c.patch();
  for (int corner = 0; corner < 4; ++corner) EXPECT_FALSE(flip_facet(patch, 0, corner));
}

TEST(RemoveEdge, ClosedRings) {
  for (int n = 3; n <= 10; ++n)
    for (unsigned seed = 1; seed < 5; ++seed) {
      Configuration c = ring(n, false, seed, 3);
      const double before = testing::worst_quality(c.mesh), volume = testing::volumes(c.mesh)[0];
      Patch<3> patch = c.patch();
      if (remove_edge(patch, 0, 1, {9, 9, 9})) {
        EXPECT_TRUE(patch.cells_around(std::array<VertexId, 2>{0, 1}).empty());
        c.compact_after(patch);
        EXPECT_EQ(c.mesh.blocks[0].size(), 2 * (n - 2));
        EXPECT_GT(testing::worst_quality(c.mesh), before);
      }
      EXPECT_NEAR(testing::volumes(c.mesh)[0], volume, 1e-12);
    }
  Configuration thin = ring(6, false, 1, 0.7);
  Patch<3> patch = thin.patch();
  EXPECT_TRUE(remove_edge(patch, 0, 1, {9, 9, 9}) || testing::worst_quality(thin.mesh) > 40);
}

TEST(RemoveEdge, OnASideOfTheBoxOnly) {
  for (const double height : {1.2, 1.6, 2.0}) {
    Configuration c = ring(2, true, 1, height);
    const double before = testing::worst_quality(c.mesh), volume = testing::volumes(c.mesh)[0];
    Patch<3> patch = c.patch();
    const bool removed = remove_edge(patch, 0, 1, {9, 9, 9});
    EXPECT_NEAR(testing::volumes(c.mesh)[0], volume, 1e-12);
    EXPECT_EQ(removed, testing::worst_quality(c.mesh) > before);
    // The same ring away from the box must stay.
    Configuration inside = ring(2, true, 1, height);
    for (Vec<3>& p : inside.mesh.points) p[0] += 1;
    Patch<3> other = inside.patch();
    EXPECT_FALSE(remove_edge(other, 0, 1, {9, 9, 9}));
  }
}

TEST(RemoveEdge, FlatInterfacesOnly) {
  // Four cells around a long edge, two of each material: the interface is the plane x = 0, or bent there.
  const auto flips = [](double bend) {
    Configuration c = ring(4, false, 1, 1.7, bend);
    CellBlock& block = c.mesh.blocks[0];
    for (std::int64_t i = 0; i < 4; ++i) {
      double x = 0;
      for (int k = 0; k < 4; ++k)
        x += c.mesh.points[block.cell(i)[k]][0] - bend * std::abs(c.mesh.points[block.cell(i)[k]][1]);
      block.materials[i] = x > 0;
    }
    const std::vector<double> before = testing::volumes(c.mesh);
    Patch<3> patch = c.patch();
    const bool done = remove_edge(patch, 0, 1, {9, 9, 9});
    c.compact_after(patch);
    const std::vector<double> after = testing::volumes(c.mesh);
    EXPECT_NEAR(before[0] + before[1], after[0] + after[1], 1e-12);
    EXPECT_GT(after[0], 0.3 * before[0]);
    EXPECT_GT(after[1], 0.3 * before[1]);
    return done;
  };
  EXPECT_TRUE(flips(0));
  EXPECT_FALSE(flips(0.9));
}

TEST(CollapseEdge, KeepsTheRoomOfTheStar) {
  // An octahedron around a vertex that is close to one corner.
  for (const VertexId to : {1U, 2U, 6U}) {
    Configuration c;
    c.mesh.points = {{0.9, 0.02, 0.01}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (const VertexId x : {1U, 2U})
      for (const VertexId y : {3U, 4U})
        for (const VertexId z : {5U, 6U}) c.add({0, x, y, z});
    const double before = testing::worst_quality(c.mesh), volume = testing::volumes(c.mesh)[0];
    Patch<3> patch = c.patch();
    ASSERT_TRUE(collapse_edge(patch, 0, to, {9, 9, 9}));
    c.compact_after(patch);
    EXPECT_EQ(c.mesh.points.size(), 6);
    EXPECT_EQ(c.mesh.blocks[0].size(), 4);
    EXPECT_GT(testing::worst_quality(c.mesh), before);
    EXPECT_NEAR(testing::volumes(c.mesh)[0], volume, 1e-12);
  }
}

TEST(CollapseEdge, KeepsInterfacesAndTheHull) {
  Configuration c;
  c.mesh.points = {{0.9, 0, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  for (const VertexId x : {1U, 2U})
    for (const VertexId y : {3U, 4U})
      for (const VertexId z : {5U, 6U}) c.add({0, x, y, z}, z == 5 ? 0 : 1);
  Patch<3> patch = c.patch();
  EXPECT_FALSE(collapse_edge(patch, 0, 1, {9, 9, 9})) << "an interface vertex";
  EXPECT_FALSE(collapse_edge(patch, 3, 1, {9, 9, 9})) << "a hull vertex of a curved hull";
}

}  // namespace
}  // namespace treemarch
