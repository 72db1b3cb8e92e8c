#include "treemarch/march/whole_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "support/images.h"
#include "support/meshes.h"
#include "treemarch/march/cut.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/drop_material.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"

namespace treemarch {
namespace {

template <int Dim>
Mesh<Dim> cut_image(const LabelImage<Dim>& image, double largest, bool hybrid, int threads = 2) {
  Execution execution(threads);
  const auto sized = choose_cubic_lattice(image, 1.0, largest);
  SizingRule rule;
  rule.min_size = 1;
  rule.max_size = largest;
  auto tree =
      build_spacetree<Dim>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1, execution);
  const auto field = build_field(image, {}, execution);
  CutReport report;
  const auto lattice = tessellate_body_centred<Dim>(std::move(tree), execution);
  Mesh<Dim> mesh = cut_lattice(lattice, field, image.labels, {}, report, execution);
  if (hybrid) {
    keep_whole<Dim>(mesh, lattice, report.first_far, execution);
    drop_unused_points(mesh, execution);
  }
  return mesh;
}

/// Facets between materials as points, whatever the numbering.
template <int Dim>
std::vector<std::vector<Vec<Dim>>> interfaces_of(const Mesh<Dim>& mesh) {
  std::vector<std::vector<Vec<Dim>>> facets;
  for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, Execution(1))) {
    const int corners = vertex_count(block.type);
    for (std::int64_t i = 0; i < block.size(); ++i) {
      std::vector<Vec<Dim>> facet;
      for (int k = 0; k < corners; ++k) facet.push_back(mesh.points[block.vertices[i * corners + k]]);
      std::ranges::sort(facet);
      facets.push_back(facet);
    }
  }
  std::ranges::sort(facets);
  return facets;
}

template <int Dim>
double volume_of(const Mesh<Dim>& mesh, MaterialId material) {
  double sum = 0;
  for (const CellBlock& b : mesh.blocks)
    for (std::int64_t i = 0; i < b.size(); ++i)
      if (b.materials[i] == material) sum += cell_volume<Dim>(mesh.points.data(), b.type, b.cell(i));
  return sum;
}

/// A hybrid mesh is the mesh of simplices with other cells away from the interfaces.
template <int Dim>
void expect_same_but_whole(const LabelImage<Dim>& image, double largest, bool has_boxes) {
  const Mesh<Dim> plain = cut_image(image, largest, false);
  const Mesh<Dim> hybrid = cut_image(image, largest, true);
  const MeshDefects defects = validate(hybrid, Execution(2));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_LE(hybrid.cell_count(), plain.cell_count());
  EXPECT_EQ(interfaces_of(hybrid), interfaces_of(plain));
  for (MaterialId m = 0; m < image.labels.size(); ++m)
    EXPECT_NEAR(volume_of(hybrid, m), volume_of(plain, m), 1e-9 * image.voxels.size());
  EXPECT_TRUE(testing::same_mesh(hybrid, cut_image(image, largest, true, 1)));
  const CellType box = Dim == 2 ? CellType::quad : CellType::hexahedron;
  if (has_boxes) EXPECT_EQ(std::ranges::count(hybrid.blocks, box, &CellBlock::type), 1);
  // Whole cells are those of the lattice: cubes, and pyramids of 45 to 120 degrees.
  for (const CellBlock& b : hybrid.blocks) {
    if (b.type == kSimplex<Dim>) continue;
    for (std::int64_t i = 0; i < b.size(); ++i) {
      const DegreeRange angles = cell_angles<Dim>(hybrid.points.data(), b.type, b.cell(i));
      ASSERT_GE(angles.min, b.type == box ? 90 - 1e-6 : 45 - 1e-6);
      ASSERT_LE(angles.max, b.type == box ? 90 + 1e-6 : 120 + 1e-6);
    }
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

}  // namespace
}  // namespace treemarch
