#include "treemarch/pipeline/drop_material.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "support/images.h"
#include "support/voxel_mesh.h"

namespace treemarch {
namespace {

/// Corners of a cell, as positions.
template <int Dim>
std::vector<Vec<Dim>> corners(const Mesh<Dim>& mesh, const CellBlock& block, std::int64_t cell) {
  std::vector<Vec<Dim>> p;
  for (int i = 0; i < vertex_count(block.type); ++i) p.push_back(mesh.points[block.cell(cell)[i]]);
  return p;
}

template <int Dim>
void expect_rest_unchanged(const LabelImage<Dim>& image, MaterialId material) {
  const Mesh<Dim> before = testing::voxel_mesh(image);
  Mesh<Dim> after = before;
  Execution execution(3);
  drop_material(after, material, execution);

  std::int64_t next = 0;
  std::set<VertexId> used;
  for (std::int64_t c = 0; c < before.blocks[0].size(); ++c) {
    if (before.blocks[0].materials[static_cast<std::size_t>(c)] == material) continue;
    ASSERT_EQ(after.blocks[0].materials[static_cast<std::size_t>(next)],
              before.blocks[0].materials[static_cast<std::size_t>(c)]);
    ASSERT_EQ(corners(after, after.blocks[0], next), corners(before, before.blocks[0], c));
    ++next;
  }
  EXPECT_EQ(after.cell_count(), next);
  for (const VertexId v : after.blocks[0].vertices) used.insert(v);
  EXPECT_EQ(used.size(), after.points.size()) << "every point is used";
  EXPECT_EQ(after.labels, before.labels);
}

TEST(DropMaterial, LeavesTheRestAsItWas) {
  expect_rest_unchanged(testing::ball_image<2>({30, 20}, 0.4), 0);
  expect_rest_unchanged(testing::ball_image<2>({30, 20}, 0.4), 1);
  expect_rest_unchanged(testing::noise_image<3>({50, 51, 53}, 3, 1), 2);
}

TEST(DropMaterial, OfAllCellsLeavesNothing) {
  auto mesh = testing::voxel_mesh(testing::ball_image<2>({5, 5}, 10));
  Execution execution(1);
  drop_material(mesh, 0, execution);
  EXPECT_TRUE(mesh.blocks.empty());
  EXPECT_TRUE(mesh.points.empty());
}

}  // namespace
}  // namespace treemarch
