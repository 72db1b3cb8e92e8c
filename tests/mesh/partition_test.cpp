#include "treemarch/mesh/partition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "support/meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/interfaces.h"

namespace treemarch {
namespace {

using testing::box_mesh;

template <int Dim>
void expect_good_partition(Mesh<Dim> mesh, int parts) {
  Execution one(1), three(3);
  const Partition p = partition_mesh(mesh, parts, one);
  const Partition again = partition_mesh(mesh, parts, three);
  EXPECT_EQ(p.cell_part, again.cell_part);
  ASSERT_EQ(std::ssize(p.cell_part), mesh.cell_count());
  ASSERT_EQ(p.vertex_part.size(), mesh.points.size());
  std::vector<std::int64_t> count(static_cast<std::size_t>(parts));
  for (const std::int32_t part : p.cell_part) {
    ASSERT_TRUE(part >= 0 && part < parts);
    ++count[static_cast<std::size_t>(part)];
  }
  EXPECT_EQ(p.cells, count);
  const double mean = static_cast<double>(mesh.cell_count()) / parts;
  for (const std::int64_t n : count) EXPECT_NEAR(static_cast<double>(n), mean, 0.1 * mean + 1);

  // Every vertex is owned by a part that has a cell there; who shares one, by cells alone.
  std::vector<std::set<std::int32_t>> around(mesh.points.size());
  std::size_t c = 0;
  for (const CellBlock& block : mesh.blocks)
    for (std::int64_t i = 0; i < block.size(); ++i, ++c)
      for (int k = 0; k < vertex_count(block.type); ++k) around[block.cell(i)[k]].insert(p.cell_part[c]);
  std::int64_t shared = 0;
  for (std::size_t v = 0; v < around.size(); ++v) {
    EXPECT_EQ(p.vertex_part[v], *around[v].begin());
    shared += around[v].size() > 1;
  }
  EXPECT_EQ(p.vertices_between, shared);

  if constexpr (Dim < 4) {  // facets between parts are interfaces where parts are the materials
    c = 0;
    mesh.labels.clear();
    for (int i = 0; i < parts; ++i) mesh.labels.push_back(i);
    for (CellBlock& block : mesh.blocks)
      for (MaterialId& m : block.materials) m = static_cast<MaterialId>(p.cell_part[c++]);
    std::int64_t facets = 0;
    for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, one)) facets += block.size();
    EXPECT_EQ(p.facets_between, facets);
  }
}

TEST(Partition, IsEvenAndCountsWhatPartsShare) {
  const auto label = [](const auto& c) { return c[0] % 2; };
  expect_good_partition<2>(box_mesh<2>({30, 20}, label), 5);
  expect_good_partition<3>(box_mesh<3>({8, 9, 7}, label), 2);
  expect_good_partition<3>(box_mesh<3>({8, 9, 7}, label), 12);
  expect_good_partition<4>(box_mesh<4>({4, 3, 3, 4}, label), 3);
}

TEST(Partition, OfMixedCells) {
  Execution execution(1);
  const Partition p = partition_mesh(testing::mixed_mesh(), 2, execution);
  EXPECT_EQ(std::ssize(p.cell_part), testing::mixed_mesh().cell_count());
  EXPECT_GT(*std::ranges::min_element(p.cells), 0);
}

TEST(Partition, RefusesWhatCannotBe) {
  Execution execution(1);
  const auto mesh = box_mesh<2>({1, 1}, [](const Coord<2>&) { return 1; });
  EXPECT_THROW(partition_mesh(mesh, 1, execution), Error);
  EXPECT_THROW(partition_mesh(mesh, 3, execution), Error);
}

}  // namespace
}  // namespace treemarch
