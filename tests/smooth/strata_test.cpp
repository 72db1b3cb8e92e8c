#include "treemarch/smooth/strata.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "march/march_meshes.h"

namespace treemarch {
namespace {

/// Four columns of a box along the last axis: their corner edge is a curve (3D) or a point (2D).
template <int Dim>
Mesh<Dim> columns() {
  Coord<Dim> extent;
  extent.fill(4);
  return testing::box_mesh<Dim>(extent, [](const Coord<Dim>& c) { return 1 + (c[0] >= 2) + 2 * (c[1] >= 2); });
}

template <int Dim>
std::vector<Vec<Dim>> points_of(const Mesh<Dim>& mesh, const SubsetGraph& graph) {
  std::vector<Vec<Dim>> points;
  for (const VertexId v : graph.vertices) points.push_back(mesh.points[v]);
  return points;
}

TEST(Strata, CurveOfFourColumns) {
  const auto mesh = columns<3>();
  Execution execution(1);
  const Strata<3> strata(mesh, execution);
  const SubsetGraph curve = strata.graph(Subset::curve, execution);
  // The ends lie on the hull and are fixed.
  EXPECT_EQ(points_of(mesh, curve), (std::vector<Vec<3>>{{2, 2, 1}, {2, 2, 2}, {2, 2, 3}}));
  for (std::size_t i = 0; i < curve.vertices.size(); ++i) {
    ASSERT_EQ(curve.neighbours_of(i).size(), 2U);
    for (const VertexId w : curve.neighbours_of(i)) {
      EXPECT_EQ(squared_norm(mesh.points[w] - mesh.points[curve.vertices[i]]), 1);
      EXPECT_EQ(mesh.points[w][0], 2);
    }
  }
}

TEST(Strata, InterfacesKeepToTheirPlaneAndTheHull) {
  const auto mesh = columns<3>();
  Execution execution(1);
  const Strata<3> strata(mesh, execution);
  const SubsetGraph graph = strata.graph(Subset::interface, execution);
  int rim = 0;
  for (std::size_t i = 0; i < graph.vertices.size(); ++i) {
    const Vec<3>& x = mesh.points[graph.vertices[i]];
    ASSERT_NE(x[0] == 2, x[1] == 2);
    const int plane = x[0] == 2 ? 0 : 1;
    for (const VertexId w : graph.neighbours_of(i)) EXPECT_EQ(mesh.points[w][plane], 2);
    const bool on_hull = std::ranges::any_of(x, [](double c) { return c == 0 || c == 4; });
    EXPECT_EQ(strata.pinned(graph.vertices[i]) != 0, on_hull);
    rim += on_hull;
    EXPECT_EQ(graph.neighbours_of(i).size() == 2, on_hull);
  }
  // Four half planes of 1 x 3 inner vertices, each with 2 x 1 vertices at the top and bottom and 3 at the side.
  EXPECT_EQ(graph.vertices.size(), 4 * (3 + 2 + 3));
  EXPECT_EQ(rim, 4 * (2 + 3));
}

TEST(Strata, VolumeOfTheHullAndInside) {
  const auto mesh = columns<3>();
  Execution execution(1);
  const Strata<3> strata(mesh, execution);
  const SubsetGraph graph = strata.graph(Subset::volume, execution);
  for (std::size_t i = 0; i < graph.vertices.size(); ++i) {
    const Vec<3>& x = mesh.points[graph.vertices[i]];
    EXPECT_TRUE(x[0] != 2 && x[1] != 2);
    int pinned = 0;
    for (int d = 0; d < 3; ++d) {
      if (x[d] != 0 && x[d] != 4) continue;
      ++pinned;
      for (const VertexId w : graph.neighbours_of(i)) EXPECT_EQ(mesh.points[w][d], x[d]);
    }
    EXPECT_LT(pinned, 3);
  }
  // Everything off the two planes but the eight corners of the box.
  EXPECT_EQ(graph.vertices.size(), 4 * 4 * 5 - 8);
}

TEST(Strata, PointsAreFixedIn2D) {
  const auto mesh = columns<2>();
  Execution execution(1);
  const Strata<2> strata(mesh, execution);
  EXPECT_TRUE(strata.graph(Subset::curve, execution).vertices.empty());
  const auto points = points_of(mesh, strata.graph(Subset::interface, execution));
  EXPECT_EQ(points, (std::vector<Vec<2>>{{2, 1}, {1, 2}, {3, 2}, {2, 3}}));
}

TEST(Strata, BlocksOfAColourAreIndependent) {
  auto mesh = testing::noise_mesh<3>(20, 3, 2);
  testing::jitter(mesh, 0.2, 20, 4);
  Execution execution(2);
  const Strata<3> strata(mesh, execution);
  for (const Subset subset : {Subset::curve, Subset::interface, Subset::volume}) {
    const SubsetGraph graph = strata.graph(subset, execution);
    ASSERT_EQ(graph.colours.back() + 1, graph.blocks.size());
    ASSERT_EQ(graph.blocks.back(), graph.vertices.size());
    EXPECT_LE(graph.colours.size(), 9U);
    std::vector<std::uint32_t> positions = graph.by_block;
    std::ranges::sort(positions);
    for (std::uint32_t i = 0; i < positions.size(); ++i) ASSERT_EQ(positions[i], i);
    for (std::size_t colour = 0; colour + 1 < graph.colours.size(); ++colour) {
      std::vector<std::uint32_t> block_of(mesh.points.size(), 0);
      for (std::uint32_t b = graph.colours[colour]; b < graph.colours[colour + 1]; ++b) {
        ASSERT_LT(graph.blocks[b], graph.blocks[b + 1]);
        for (std::uint32_t i = graph.blocks[b]; i < graph.blocks[b + 1]; ++i)
          block_of[graph.vertices[graph.by_block[i]]] = b + 1;
      }
      const CellBlock& cells = mesh.blocks[0];
      for (std::int64_t c = 0; c < cells.size(); ++c) {
        std::set<std::uint32_t> blocks;
        for (int k = 0; k < 4; ++k) blocks.insert(block_of[cells.cell(c)[k]]);
        blocks.erase(0);
        EXPECT_LE(blocks.size(), 1U);
      }
    }
  }
}

}  // namespace
}  // namespace treemarch
