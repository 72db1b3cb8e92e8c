#include "treemarch/march/paper_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <vector>

#include "march/march_meshes.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// What the links say must be what a look at all cells says.
template <int Dim>
void expect_consistent(const ActiveCells<Dim>& cells, VertexId points) {
  std::vector<std::set<std::pair<std::uint32_t, int>>> expected(points);
  std::map<std::set<VertexId>, std::set<std::uint32_t>> at_facet;
  for (std::uint32_t c = 0; c < cells.size(); ++c) {
    for (int k = 0; k <= Dim; ++k) {
      expected[cells.cell(c)[k]].insert({c, k});
      std::set<VertexId> facet(cells.cell(c).begin(), cells.cell(c).end());
      facet.erase(cells.cell(c)[k]);
      at_facet[facet].insert(c);
    }
  }
  for (VertexId v = 0; v < points; ++v) {
    if (!cells.linked(v)) continue;
    std::set<std::pair<std::uint32_t, int>> found;
    cells.for_each_cell(v, [&](std::uint32_t c, int corner) { EXPECT_TRUE(found.insert({c, corner}).second); });
    EXPECT_EQ(found, expected[v]);
  }
  for (const auto& [facet, at] : at_facet) {
    if (std::ranges::none_of(facet, [&](VertexId v) { return cells.linked(v); })) continue;
    for (const std::uint32_t c : at) {
      const auto& cell = cells.cell(c);
      const auto away = std::ranges::find_if(cell, [&](VertexId v) { return !facet.contains(v); }) - cell.begin();
      const std::uint32_t other = cells.neighbour(c, static_cast<int>(away));
      EXPECT_EQ(other, at.size() == 1 ? ActiveCells<Dim>::kNone : *at.begin() == c ? *at.rbegin() : *at.begin());
    }
  }
}

TEST(ActiveCells, AreTheCellsAtVerticesOfTwoMaterials) {
  const auto mesh = testing::ball_mesh<3>(8, 2.6);
  const ActiveCells<3> cells(mesh);
  std::vector<int> seen(mesh.points.size(), 0);
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t i = 0; i < block.size(); ++i) {
    for (int k = 0; k < 4; ++k) seen[block.cell(i)[k]] |= 1 << block.materials[i];
  }
  std::uint32_t active = 0;
  for (std::int64_t i = 0; i < block.size(); ++i) {
    active += std::any_of(block.cell(i), block.cell(i) + 4, [&](VertexId v) { return seen[v] == 3; });
  }
  EXPECT_EQ(cells.size(), active);
  EXPECT_LT(active, block.size());
  for (VertexId v = 0; v < seen.size(); ++v) EXPECT_EQ(cells.linked(v), seen[v] == 3);
  expect_consistent(cells, static_cast<VertexId>(seen.size()));
}

TEST(ActiveCells, SplittingKeepsLinksAndPlace) {
  auto mesh = testing::noise_mesh<2>(4, 3, 5);
  const auto before = mesh;
  ActiveCells<2> cells(mesh);
  // An inner edge is split, and the cells on both sides of it.
  const std::uint32_t c = 9;
  const int away = cells.neighbour(c, 0) != ActiveCells<2>::kNone ? 0 : 1;
  const std::uint32_t other = cells.neighbour(c, away);
  ASSERT_NE(other, ActiveCells<2>::kNone);
  const VertexId a = cells.cell(c)[(away + 1) % 3];
  const VertexId b = cells.cell(c)[(away + 2) % 3];
  const auto middle = static_cast<VertexId>(mesh.points.size());
  mesh.points.push_back(0.5 * (mesh.points[a] + mesh.points[b]));
  cells.add_vertices(1);
  for (const std::uint32_t split : {c, other}) {
    auto first = cells.cell(split);
    auto second = first;
    std::ranges::replace(first, a, middle);
    std::ranges::replace(second, b, middle);
    cells.replace(split, std::array{first, second}, std::array<MaterialId, 2>{0, 1});
  }
  expect_consistent(cells, middle + 1);
  cells.write_back(mesh);
  EXPECT_EQ(mesh.cell_count(), before.cell_count() + 2);
  // Without the new vertex's cells the old order remains.
  const auto untouched = [&](const Mesh<2>& m) {
    std::vector<std::array<VertexId, 4>> rows;
    for (std::int64_t i = 0; i < m.cell_count(); ++i) {
      const VertexId* v = m.blocks[0].cell(i);
      const bool old = std::count(v, v + 3, middle) == 0 && !(std::count(v, v + 3, a) && std::count(v, v + 3, b));
      if (old) rows.push_back({v[0], v[1], v[2], m.blocks[0].materials[i]});
    }
    return rows;
  };
  EXPECT_EQ(untouched(mesh), untouched(before));
  // The pieces stand side by side, where their cell stood.
  for (std::int64_t i = 0; i + 1 < mesh.cell_count(); ++i) {
    const VertexId* v = mesh.blocks[0].cell(i);
    if (std::count(v, v + 6, middle) == 2) {
      EXPECT_EQ(mesh.blocks[0].materials[i], 0U);
      EXPECT_EQ(mesh.blocks[0].materials[i + 1], 1U);
      ++i;
    }
  }
}

TEST(ActiveCells, WithoutInterfacesThereAreNone) {
  auto mesh = testing::noise_mesh<3>(3, 1, 5);
  const auto before = mesh;
  const ActiveCells<3> cells(mesh);
  EXPECT_EQ(cells.size(), 0U);
  cells.write_back(mesh);
  EXPECT_TRUE(testing::same_mesh(mesh, before));
}

TEST(ActiveCells, OtherCellsThanSimplicesMayNotTouchTwoMaterials) {
  EXPECT_THROW(ActiveCells<3>(testing::mixed_mesh()), Error);
}

}  // namespace
}  // namespace treemarch
