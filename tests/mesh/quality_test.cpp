#include "treemarch/mesh/quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "support/meshes.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::mixed_mesh;

TEST(DihedralAngles, OfKnownTetrahedra) {
  const DegreeRange regular = dihedral_angles({Vec<3>{0, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}});
  EXPECT_NEAR(regular.min, 70.528779, 1e-6);
  EXPECT_NEAR(regular.max, 70.528779, 1e-6);
  const DegreeRange corner = dihedral_angles({Vec<3>{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
  EXPECT_NEAR(corner.min, 54.735610, 1e-6);
  EXPECT_NEAR(corner.max, 90, 1e-6);
  EXPECT_EQ(corner, dihedral_angles({Vec<3>{1, 0, 0}, {0, 0, 0}, {0, 1, 0}, {0, 0, 1}}));  // inverted
  const DegreeRange flat = dihedral_angles({Vec<3>{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}});
  EXPECT_NEAR(flat.min, 0, 1e-6);
  EXPECT_NEAR(flat.max, 180, 1e-6);
  EXPECT_EQ(dihedral_angles({Vec<3>{0, 0, 0}, {0, 0, 0}, {0, 1, 0}, {1, 1, 0}}), (DegreeRange{0, 180}));
}

TEST(TriangleAngles, OfKnownTriangles) {
  const DegreeRange a = triangle_angles({Vec<2>{0, 0}, {1, 0}, {0, std::sqrt(3.0)}});
  EXPECT_NEAR(a.min, 30, 1e-9);
  EXPECT_NEAR(a.max, 90, 1e-9);
}

TEST(CellAngles, OfMixedCells) {
  const Mesh<3> mesh = mixed_mesh();
  for (const CellBlock& block : mesh.blocks) {
    const DegreeRange a = cell_angles<3>(mesh.points.data(), block.type, block.cell(0));
    if (block.type == CellType::hexahedron) {
      EXPECT_NEAR(a.min, 90, 1e-9);
      EXPECT_NEAR(a.max, 90, 1e-9);
    }
    if (block.type == CellType::pyramid) {
      EXPECT_NEAR(a.min, 45, 1e-9);
      EXPECT_NEAR(a.max, 120, 1e-9);
    }
  }
}

TEST(Quality, SumsUpAllCells) {
  const Mesh<3> mesh = box_mesh<3>({30, 20, 10}, [](const Coord<3>& c) { return c[0]; }, {1, 1, 2});
  const MeshQuality q = measure_quality(mesh, Frame<3>{}, 5, Execution(2));
  EXPECT_EQ(std::accumulate(q.smallest.begin(), q.smallest.end(), std::int64_t{0}), mesh.cell_count());
  EXPECT_EQ(std::accumulate(q.largest.begin(), q.largest.end(), std::int64_t{0}), mesh.cell_count());
  EXPECT_GT(q.smallest[static_cast<int>(q.angles.min)], 0);
  ASSERT_EQ(q.worst.size(), 5U);
  EXPECT_EQ(q.worst[0].angles.min, q.angles.min);
  EXPECT_GE(q.mean_smallest, q.angles.min);
}

TEST(Quality, IsThatOfEachTetrahedronAlone) {
  std::mt19937 random(3);
  Mesh<3> mesh;
  CellBlock block(CellType::tetrahedron);
  for (int c = 0; c < 203; ++c) {
    for (int i = 0; i < 4; ++i) {
      block.vertices.push_back(static_cast<VertexId>(mesh.points.size()));
      mesh.points.push_back({1e-3 * (random() % 1000), 1e-3 * (random() % 1000), 1e-3 * (random() % 1000)});
    }
    if (c % 10 == 0) mesh.points.back() = mesh.points[mesh.points.size() - 2];  // facets without extent
    block.materials.push_back(0);
  }
  mesh.labels = {1};
  mesh.blocks.push_back(block);
  for (const int cells : {203, 202, 201, 200, 1}) {
    mesh.blocks[0].vertices.resize(static_cast<std::size_t>(4 * cells));
    mesh.blocks[0].materials.resize(static_cast<std::size_t>(cells));
    const MeshQuality quality = measure_quality(mesh, Frame<3>{}, cells, Execution(2));
    ASSERT_EQ(std::ssize(quality.worst), cells);
    for (const WorstCell& w : quality.worst)
      EXPECT_EQ(w.angles, cell_angles(mesh.points.data(), w.type, mesh.blocks[0].cell(w.cell))) << w.cell;
  }
}

TEST(Quality, FindsTheWorstCellAndItsPlace) {
  Mesh<3> mesh = box_mesh<3>({4, 4, 4}, [](const Coord<3>& c) { return 100 + c[2]; });
  const auto moved = static_cast<VertexId>(linear_index<3>({2, 2, 2}, {5, 5, 5}));
  mesh.points[moved][0] += 0.9;
  Frame<3> frame;
  frame.origin = {100, 0, 0};
  const MeshQuality q = measure_quality(mesh, frame, 3, Execution(2));
  for (const WorstCell& w : q.worst) {
    const VertexId* cell = mesh.blocks[0].cell(w.cell);
    EXPECT_NE(std::find(cell, cell + 4, moved), cell + 4);
    EXPECT_NEAR(w.centre[0], 102.5 - 0.5, 1);
    EXPECT_EQ(w.label, mesh.labels[mesh.blocks[0].materials[w.cell]]);
  }
}

TEST(Quality, IsThatOfTheWorld) {
  const Mesh<2> mesh = box_mesh<2>({2, 2}, [](const Coord<2>&) { return 1; });
  Frame<2> turned;
  turned.direction = {Vec<2>{0.6, 0.8}, {-0.8, 0.6}};
  Frame<2> sheared;
  sheared.direction = {Vec<2>{1, 0}, {-std::sqrt(0.5), std::sqrt(0.5)}};
  EXPECT_NEAR(measure_quality(mesh, turned, 0, Execution(1)).angles.min, 45, 1e-9);
  EXPECT_NEAR(measure_quality(mesh, turned, 0, Execution(1)).angles.max, 90, 1e-9);
  EXPECT_NEAR(measure_quality(mesh, sheared, 0, Execution(1)).angles.max, 67.5, 1e-9);
  EXPECT_NEAR(measure_quality(mesh, sheared, 0, Execution(1)).angles.min, 45, 1e-9);
}

}  // namespace
}  // namespace treemarch
