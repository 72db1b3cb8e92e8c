#include "treemarch/march/whole_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "support/images.h"
#include "support/meshes.h"
#include "treemarch/march/cut.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/drop_material.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"

namespace treemarch {
namespace {

template <int Dim>
struct Cut {
  SimplexLattice<Dim> lattice;
  Mesh<Dim> mesh;
};

template <int Dim>
Cut<Dim> cut_image(const LabelImage<Dim>& image, double largest, Execution& execution) {
  const auto sized = choose_cubic_lattice(image, 1.0, largest);
  SizingRule rule;
  rule.min_size = 1;
  rule.max_size = largest;
  auto tree =
      build_spacetree<Dim>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1, execution);
  const auto field = build_field(image, {}, execution);
  CutReport report;
  Cut<Dim> result{tessellate_body_centred<Dim>(std::move(tree), execution), {}};
  result.mesh = cut_lattice(result.lattice, field, image.labels, {}, report, execution);
  return result;
}

template <int Dim>
Mesh<Dim> hybrid_mesh(const LabelImage<Dim>& image, double largest, int threads = 2) {
  Execution execution(threads);
  auto [lattice, mesh] = cut_image(image, largest, execution);
  keep_whole<Dim>(mesh, lattice, {}, execution);
  drop_unused_points(mesh, execution);
  return mesh;
}

template <int Dim>
double volume_of(const Mesh<Dim>& mesh, MaterialId material) {
  double sum = 0;
  for (const CellBlock& b : mesh.blocks)
    for (std::int64_t i = 0; i < b.size(); ++i)
      if (b.materials[i] == material) sum += cell_volume<Dim>(mesh.points.data(), b.type, b.cell(i));
  return sum;
}

template <int Dim>
double jacobian(const Mesh<Dim>& mesh, const CellBlock& block, std::int64_t cell) {
  std::array<Vec<Dim>, 8> p{};
  for (int k = 0; k < vertex_count(block.type); ++k) p[k] = mesh.points[block.cell(cell)[k]];
  return corner_jacobians<Dim>(p, block.type).min_scaled;
}

/// A hybrid mesh is the mesh of simplices with other cells in the place of some.
template <int Dim>
void expect_same_but_whole(const LabelImage<Dim>& image, double largest, bool has_boxes) {
  Execution execution(2);
  const Mesh<Dim> plain = cut_image(image, largest, execution).mesh;
  const Mesh<Dim> hybrid = hybrid_mesh(image, largest);
  const MeshDefects defects = validate(hybrid, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_LE(hybrid.cell_count(), plain.cell_count());
  EXPECT_EQ(testing::interfaces_of(hybrid), testing::interfaces_of(plain));
  for (MaterialId m = 0; m < image.labels.size(); ++m)
    EXPECT_NEAR(volume_of(hybrid, m), volume_of(plain, m), 1e-9 * image.voxels.size());
  EXPECT_TRUE(testing::same_mesh(hybrid, hybrid_mesh(image, largest, 1)));
  const CellType box = Dim == 2 ? CellType::quad : CellType::hexahedron;
  if (has_boxes) {
    EXPECT_EQ(std::ranges::count(hybrid.blocks, box, &CellBlock::type), 1);
  }
  for (const CellBlock& b : hybrid.blocks)
    for (std::int64_t i = 0; i < b.size() && b.type != kSimplex<Dim>; ++i) {
      ASSERT_GE(jacobian(hybrid, b, i), 0.2);
      const DegreeRange angles = cell_angles<Dim>(hybrid.points.data(), b.type, b.cell(i));
      ASSERT_GE(angles.min, 20 - 1e-6);
      ASSERT_LE(angles.max, 155 + 1e-6);
    }
}

TEST(whole_cells, interfaces_are_those_of_the_mesh_of_simplices) {
  for (const double largest : {1.0, 2.0, 8.0}) {
    SCOPED_TRACE(largest);
    expect_same_but_whole(testing::ball_image<3>({20, 24, 16}, 0.3, 5), largest, true);
    expect_same_but_whole(testing::ball_image<2>({60, 50}, 0.3, 5), largest, true);
    expect_same_but_whole(testing::noise_image<3>({9, 8, 7}, 2, 4), largest, false);
    expect_same_but_whole(testing::noise_image<2>({30, 20}, 2, 4), largest, false);
  }
  expect_same_but_whole(testing::noise_image<3>({8, 8, 8}, 1, 4), 1, true);
}

/// Moves the centre of one leaf: what is around it is whole as long as the shape is good.
TEST(whole_cells, depend_on_where_the_vertices_are) {
  const auto image = testing::noise_image<3>({4, 4, 4}, 1, 1);
  for (const double by : {0.0, 0.15, 0.45}) {
    Execution execution(1);
    auto [lattice, mesh] = cut_image(image, 1, execution);
    const VertexId corner = lattice.star(0).corner[7];
    mesh.points[corner] = mesh.points[corner] + Vec<3>{by, by, by};
    keep_whole<3>(mesh, lattice, {}, execution);
    const MeshDefects defects = validate(mesh, execution);
    EXPECT_EQ(defects.inverted_cells, 0) << by;
    EXPECT_EQ(mesh.blocks.size(), by < 0.4 ? 1U : 3U) << by;  // hexahedra alone, or all kinds
  }
}

}  // namespace
}  // namespace treemarch
