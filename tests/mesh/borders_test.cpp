#include "treemarch/mesh/borders.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "support/meshes.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::mixed_mesh;

auto as_tuple(const FacetSide& s) {
  return std::tuple<std::uint64_t, std::uint64_t, std::uint64_t>(s.cell, s.block, s.facet);
}

/// By all facets of the mesh: those of the hull and between materials tell the vertices, as do materials that meet in a
/// vertex alone; then all facets between such vertices count.
template <int Dim>
void expect_borders(const Mesh<Dim>& mesh) {
  const Execution one(1);
  std::vector<std::vector<SharedFacet>> parts(
      static_cast<std::size_t>(facet_part_count(static_cast<std::int64_t>(mesh.points.size()))));
  visit_facets<Dim>(mesh, one, [&](std::int64_t part, std::span<const FacetSide> sides) {
    parts[static_cast<std::size_t>(part)].push_back(shared_facet(sides));
    EXPECT_EQ(parts[static_cast<std::size_t>(part)].back().is_on_hull(), sides.size() == 1);
  });
  const RawVector<SharedFacet> all = joined(one, parts);
  const auto vertices_of = [&](const FacetSide& side) {
    const CellBlock& block = mesh.blocks[side.block];
    const LocalFacet& facet = topology(block.type).facets[side.facet];
    std::vector<VertexId> v;
    for (int i = 0; i < facet.size; ++i)
      v.push_back(block.cell(static_cast<std::int64_t>(side.cell))[facet.vertex[static_cast<std::size_t>(i)]]);
    return v;
  };
  std::vector<std::uint8_t> vertices(mesh.points.size(), 0);
  for (const SharedFacet& f : all)
    if (f.is_on_hull())
      for (const VertexId v : vertices_of(f.own)) vertices[v] = 1;
  std::vector<MaterialId> met(mesh.points.size(), kOutside);
  for (const CellBlock& block : mesh.blocks)
    for (std::int64_t c = 0; c < block.size(); ++c)
      for (int i = 0; i < vertex_count(block.type); ++i) {
        const VertexId v = block.cell(c)[i];
        const MaterialId m = block.materials[static_cast<std::size_t>(c)];
        if (met[v] != kOutside && met[v] != m) vertices[v] = 1;
        met[v] = m;
      }
  std::vector<SharedFacet> facets;
  for (const SharedFacet& f : all)
    if (std::ranges::all_of(vertices_of(f.own), [&](VertexId v) { return vertices[v] != 0; })) facets.push_back(f);

  for (const int threads : {1, 3}) {
    const Borders borders = find_borders(mesh, Execution(threads));
    EXPECT_EQ(borders.vertices, vertices);
    ASSERT_EQ(borders.facets.size(), facets.size());
    for (std::size_t i = 0; i < facets.size(); ++i) {
      EXPECT_EQ(as_tuple(borders.facets[i].own), as_tuple(facets[i].own));
      EXPECT_EQ(as_tuple(borders.facets[i].beyond), as_tuple(facets[i].beyond));
    }
  }
}

TEST(Borders, AreWhatAllFacetsSay) {
  expect_borders(mixed_mesh());
  for (const int period : {1, 2, 5}) {
    const auto chequered = [&](const auto& c) {
      int sum = 0;
      for (const std::int32_t x : c) sum += x / period;
      return sum % 3;
    };
    expect_borders(box_mesh<2>({9, 7}, chequered));
    expect_borders(box_mesh<3>({7, 6, 5}, chequered));
    expect_borders(box_mesh<4>({4, 3, 3, 3}, chequered));
  }
}

}  // namespace
}  // namespace treemarch
