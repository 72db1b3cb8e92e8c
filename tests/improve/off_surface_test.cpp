#include "treemarch/improve/off_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "improve/improve_meshes.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

template <int Dim>
void check_vertices() {
  Coord<Dim> extent{};
  extent.fill(11);
  auto cut = testing::cut_image(testing::mixed_image<Dim>(extent, 4, 0.1, 5));
  std::vector<std::set<MaterialId>> around(cut.mesh.points.size());
  const CellBlock& block = cut.mesh.blocks[0];
  for (std::int64_t c = 0; c < block.size(); ++c)
    for (int k = 0; k <= Dim; ++k) around[block.cell(c)[k]].insert(block.materials[c]);
  std::vector<VertexId> expected;
  for (VertexId v = 0; v < around.size(); ++v) {
    std::array<LabelWeight, 8> w;
    const int n = cut.field.sample(cut.mesh.points[v], w);
    if (around[v].size() > 1 && (n == 1 || w[0].weight - w[1].weight > 0.05F)) expected.push_back(v);
  }
  ASSERT_FALSE(expected.empty());
  for (const int threads : {1, 2, 7}) {
    const Execution execution(threads);
    MaterialsAround materials(cut.mesh.points.size());
    parallel_for(execution, block.size(), 16, [&](std::int64_t c) {
      for (int k = 0; k <= Dim; ++k) materials.add(block.cell(c)[k], block.materials[c]);
    });
    EXPECT_EQ(off_surface_vertices(cut.mesh.points, materials, cut.field, 0.05F, execution), expected);
  }
}

TEST(OffSurface, FindsTheVerticesBetweenMaterialsThatTheFieldDoesNotHaveThere2D) { check_vertices<2>(); }
TEST(OffSurface, FindsTheVerticesBetweenMaterialsThatTheFieldDoesNotHaveThere3D) { check_vertices<3>(); }

}  // namespace
}  // namespace treemarch
