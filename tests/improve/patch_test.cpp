#include "treemarch/improve/patch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "improve/improve_meshes.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

/// The star of a vertex by looking at all cells.
template <int Dim>
std::vector<CellId> star_of(const Mesh<Dim>& mesh, VertexId v) {
  std::vector<CellId> star;
  const auto& vertices = mesh.blocks[0].vertices;
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (vertices[i] == v) star.push_back(static_cast<CellId>(i / (Dim + 1)));
  return star;
}

template <int Dim>
void expect_stars(const Mesh<Dim>& mesh, const Patch<Dim>& patch) {
  for (const VertexId v : patch.chosen()) {
    std::vector<CellId> star(patch.star(v).begin(), patch.star(v).end());
    std::ranges::sort(star);
    ASSERT_EQ(star, star_of(mesh, v)) << "vertex " << v;
  }
}

template <int Dim>
void bisect(Patch<Dim>& patch, VertexId a, VertexId b) {
  const std::array<VertexId, 2> edge{a, b};
  const auto around = patch.cells_around(edge);
  const VertexId m = patch.add_vertex(0.5 * (patch.point(a) + patch.point(b)));
  std::vector<NewCell<Dim>> cells;
  for (const CellId c : around)
    for (const VertexId end : {a, b}) {
      cells.push_back({patch.cell(c), patch.material(c)});
      *std::ranges::find(cells.back().vertices, end) = m;
    }
  patch.replace(around, cells);
}

template <int Dim>
void check_patch() {
  Coord<Dim> extent{};
  extent.fill(6);
  Mesh<Dim> mesh = testing::cut_image(testing::noise_image<Dim>(extent, 3, 2)).mesh;
  const Mesh<Dim> first = mesh;
  std::vector<VertexId> chosen;
  for (VertexId v = 0; v < mesh.points.size(); v += 2) chosen.push_back(v);
  Execution execution(2);
  Patch<Dim> patch(mesh, chosen, execution);
  expect_stars(mesh, patch);

  std::mt19937 random(1);
  for (int step = 0; step < 60; ++step) {
    const Mesh<Dim> before = mesh;
    const VertexId a = chosen[random() % chosen.size()];
    const SimplexVertices<Dim> cell = patch.cell(patch.star(a)[0]);
    const VertexId b = cell[0] == a ? cell[1] : cell[0];
    patch.begin();
    bisect(patch, a, b);
    patch.move(a, patch.point(a) + Vec<Dim>{0.001, 0.002});
    bisect(patch, a, patch.chosen().back());
    EXPECT_GE(patch.written().size(), 4U);
    if (step % 3 == 0) {
      patch.commit();
      continue;
    }
    patch.rollback();
    ASSERT_EQ(mesh.points, before.points);
    for (std::size_t i = 0; i < before.blocks[0].vertices.size(); ++i)
      ASSERT_EQ(mesh.blocks[0].vertices[i], before.blocks[0].vertices[i]);
  }
  expect_stars(mesh, patch);
  Removed removed;
  patch.list_removed(removed);
  compact(mesh, removed, execution);
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_EQ(defects.bad_cells + defects.overused_facets + defects.folded_facets + defects.unused_points, 0)
      << defects.describe();
  EXPECT_GT(mesh.cell_count(), first.cell_count());
}

TEST(Patch, StarsFollowChangesAndRollbackTakesThemBack2D) { check_patch<2>(); }
TEST(Patch, StarsFollowChangesAndRollbackTakesThemBack3D) { check_patch<3>(); }

TEST(Patch, NeighboursShareTheFacet) {
  Mesh<3> mesh = testing::cut_image(testing::noise_image<3>({4, 4, 4}, 2, 3)).mesh;
  const std::vector<VertexId> all = testing::all_vertices(mesh);
  Execution execution(2);
  const Patch<3> patch(mesh, all, execution);
  std::int64_t hull = 0;
  for (CellId c = 0; c < mesh.blocks[0].size(); ++c)
    for (int corner = 0; corner < 4; ++corner) {
      const CellId n = patch.neighbour(c, corner);
      if (n == Patch<3>::kNoCell) {
        ++hull;
        continue;
      }
      int shared = 0;
      for (const VertexId v : patch.cell(n)) shared += std::ranges::count(patch.cell(c), v);
      EXPECT_EQ(shared, 3);
      EXPECT_EQ(std::ranges::count(patch.cell(n), patch.cell(c)[corner]), 0);
    }
  EXPECT_EQ(hull, validate(mesh, execution).hull_facets);
}

TEST(Patch, KeepsAnchorsBeyondAllCellsOfAVertex) {
  Mesh<2> mesh;
  mesh.points = {{0, 0}, {4, 0}, {2, 2}};
  mesh.labels = {5};
  mesh.blocks = {{CellType::triangle, {0, 1, 2}, {0}}};
  const std::vector<VertexId> all = testing::all_vertices(mesh);
  Execution execution(1);
  Patch<2> patch(mesh, all, execution);
  const Anchor within{.point = {2, 1.5, 0}, .inside = true}, beyond{.point = {2, 3, 0}, .inside = false};
  const std::vector<Anchor> anchors{within, beyond};
  patch.guard(anchors);
  EXPECT_TRUE(patch.keeps_anchors(2, {2, 1.75}));
  EXPECT_FALSE(patch.keeps_anchors(2, {2, 1.25}));
  EXPECT_TRUE(patch.keeps_anchors(2, {2, 2.5}));
  EXPECT_FALSE(patch.keeps_anchors(2, {2, 3.5}));  // the vertex is on the hull: no cell is there before
}

TEST(Compact, DropsCellsAndVerticesAndKeepsTheRest) {
  Mesh<3> mesh = testing::cut_image(testing::noise_image<3>({4, 4, 4}, 2, 3)).mesh;
  // Without all cells around some vertices.
  Removed removed;
  for (const VertexId v : {3U, 40U, static_cast<VertexId>(mesh.points.size() - 1)}) {
    removed.vertices.push_back(v);
    for (const CellId c : star_of(mesh, v)) removed.cells.push_back(c);
  }
  std::ranges::sort(removed.cells);
  removed.cells.erase(std::unique(removed.cells.begin(), removed.cells.end()), removed.cells.end());
  using Corners = std::vector<Vec<3>>;
  const auto cells_of = [](const Mesh<3>& m) {
    std::vector<std::pair<Corners, MaterialId>> cells;
    for (std::int64_t c = 0; c < m.blocks[0].size(); ++c) {
      Corners p;
      for (int k = 0; k < 4; ++k) p.push_back(m.points[m.blocks[0].cell(c)[k]]);
      cells.push_back({p, m.blocks[0].materials[c]});
    }
    return cells;
  };
  auto expected = cells_of(mesh);
  for (auto c = removed.cells.rbegin(); c != removed.cells.rend(); ++c) expected.erase(expected.begin() + *c);
  const std::size_t points = mesh.points.size();
  Execution execution(2);
  compact(mesh, removed, execution);
  auto kept = cells_of(mesh);
  EXPECT_EQ(mesh.points.size(), points - 3);
  std::ranges::sort(expected);
  std::ranges::sort(kept);
  EXPECT_EQ(kept, expected);
}

}  // namespace
}  // namespace treemarch
