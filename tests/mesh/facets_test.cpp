#include "treemarch/mesh/facets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "support/meshes.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::mixed_mesh;

/// All facets as sorted vertex lists with the number of their cells, in the order of the visits.
template <int Dim>
std::vector<std::pair<std::vector<VertexId>, std::size_t>> list_facets(const Mesh<Dim>& mesh, int threads) {
  using Facets = std::vector<std::pair<std::vector<VertexId>, std::size_t>>;
  const Execution execution(threads);
  std::vector<Facets> parts(facet_part_count(static_cast<std::int64_t>(mesh.points.size())));
  visit_facets<Dim>(mesh, execution, [&](std::int64_t part, std::span<const FacetSide> sides) {
    const CellBlock& block = mesh.blocks[sides[0].block];
    const LocalFacet& local = topology(block.type).facets[sides[0].facet];
    std::vector<VertexId> v;
    for (int i = 0; i < local.size; ++i) v.push_back(block.cell(sides[0].cell)[local.vertex[i]]);
    std::sort(v.begin(), v.end());
    parts[part].emplace_back(std::move(v), sides.size());
  });
  Facets all;
  for (const Facets& p : parts) all.insert(all.end(), p.begin(), p.end());
  return all;
}

template <int Dim>
void expect_euler(const Coord<Dim>& extent) {
  const Mesh<Dim> mesh = box_mesh<Dim>(extent, [](const Coord<Dim>&) { return 1; });
  const auto facets = list_facets(mesh, 2);
  // Every cell has Dim + 1 facets; the hull has the surface's boxes times the simplices of a box facet.
  std::int64_t hull = 0, sides = 0, surface = 0, per_box_facet = 1;
  for (const auto& [v, n] : facets) {
    sides += static_cast<std::int64_t>(n);
    hull += n == 1;
    ASSERT_LE(n, 2U);
  }
  for (int d = 0; d < Dim; ++d) surface += 2 * product(extent) / extent[d];
  for (int d = 2; d < Dim; ++d) per_box_facet *= d;
  EXPECT_EQ(sides, mesh.cell_count() * (Dim + 1));
  EXPECT_EQ(hull, surface * per_box_facet);
  const std::set<std::vector<VertexId>> distinct = [&] {
    std::set<std::vector<VertexId>> s;
    for (const auto& f : facets) s.insert(f.first);
    return s;
  }();
  EXPECT_EQ(distinct.size(), facets.size());
  EXPECT_TRUE(std::is_sorted(facets.begin(), facets.end()));
}

TEST(Facets, AreVisitedOnceInOrderInEveryDimension) {
  expect_euler<1>({7});
  expect_euler<2>({5, 4});
  expect_euler<3>({4, 3, 5});
  expect_euler<4>({2, 3, 2, 2});
}

TEST(Facets, DoNotDependOnThreads) {
  const Mesh<3> mesh = box_mesh<3>({33, 20, 21}, [](const Coord<3>&) { return 1; });
  EXPECT_EQ(list_facets(mesh, 1), list_facets(mesh, 3));
}

TEST(Facets, MatchAcrossCellTypes) {
  std::size_t hull = 0, inner = 0;
  for (const auto& [v, n] : list_facets(mixed_mesh(), 1)) ++(n == 1 ? hull : inner);
  // Hull: the hexahedron's bottom and sides, above it two quads and twice two triangles, on top two triangles.
  EXPECT_EQ(hull, 5U + 2U + 4U + 2U);
  // Below the lowest pyramid, then the sides between the pieces around the midpoint: one for each edge of its hull.
  EXPECT_EQ(inner, 1U + 15U);
}

TEST(Facets, QuadIsNoTriangle) {
  Mesh<3> mesh = mixed_mesh();
  // Two tetrahedra instead of the lowest pyramid: their triangles do not match the hexahedron's quad.
  mesh.blocks[1].vertices.erase(mesh.blocks[1].vertices.begin(), mesh.blocks[1].vertices.begin() + 5);
  mesh.blocks[1].materials.erase(mesh.blocks[1].materials.begin());
  mesh.blocks[0].vertices.insert(mesh.blocks[0].vertices.end(), {4, 5, 6, 12, 4, 6, 7, 12});
  mesh.blocks[0].materials.insert(mesh.blocks[0].materials.end(), {2, 2});
  std::size_t hull = 0;
  for (const auto& [v, n] : list_facets(mesh, 1)) hull += n == 1;
  EXPECT_EQ(hull, 13U + 3U);
}

}  // namespace
}  // namespace treemarch
