#include "treemarch/repair/repair_topology.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "support/images.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/topology/component_fates.h"

namespace treemarch {
namespace {

template <int Dim>
MeshResult<Dim> mesh_of(const LabelImage<Dim>& image, int threads = 2) {
  MeshOptions options;
  options.sizes.min_size = 1;
  options.keep_background = true;
  Execution execution(threads);
  return mesh_image(image, options, execution);
}

/// Components of `least` voxels and more that are lost or in several parts.
template <int Dim>
std::int64_t broken_components(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::int64_t least) {
  const Execution execution(2);
  const ComponentMap map = map_components(image, execution);
  std::vector<MaterialId> same(image.labels.size());
  std::iota(same.begin(), same.end(), 0U);
  const MeshComponents<Dim> components(mesh, execution);
  const UniformBlocks<Dim> uniform(image, execution);
  const PlainBlocks<Dim> plain(image, uniform, mesh, components.facets(), execution);
  const auto fates = component_fates(image, map, mesh, components, plain, same, execution).of;
  std::int64_t broken = 0;
  for (std::size_t c = 0; c < fates.size(); ++c)
    broken += map.components[c].voxels >= least && (fates[c].lost() || fates[c].split());
  return broken;
}

template <int Dim>
std::size_t pinches(const Mesh<Dim>& mesh) {
  return MeshComponents<Dim>(mesh, Execution(2)).pinches().size();
}

TEST(repair_topology, noise_has_manifold_boundaries_and_whole_components) {
  std::int64_t before = 0;
  for (unsigned seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    const auto image = testing::noise_image<3>({12, 11, 10}, 2 + 6 * static_cast<int>(seed), seed);
    const auto result = mesh_of(image);
    before += result.guarantee->repair.pinches_before;
    EXPECT_EQ(pinches(result.mesh), 0U);
    EXPECT_EQ(broken_components(image, result.mesh, 8), 0);
    EXPECT_TRUE(validate(result.mesh, Execution(2)).fills_box());
    const auto plane = testing::noise_image<2>({40, 30}, 2 + static_cast<int>(seed), seed);
    const auto flat = mesh_of(plane);
    EXPECT_EQ(pinches(flat.mesh), 0U);
    EXPECT_EQ(broken_components(plane, flat.mesh, 8), 0);
  }
  EXPECT_GT(before, 300);
}

TEST(repair_topology, does_not_depend_on_the_number_of_threads) {
  const auto image = testing::noise_image<3>({12, 10, 11}, 3, 9);
  const auto one = mesh_of(image, 1).mesh, many = mesh_of(image, 5).mesh;
  EXPECT_EQ(one.points, many.points);
  EXPECT_EQ(one.blocks[0].vertices, many.blocks[0].vertices);
  EXPECT_EQ(one.blocks[0].materials, many.blocks[0].materials);
}

TEST(repair_topology, restores_a_component_and_joins_parts) {
  // A bar of label 1 from which the mesh lacks the middle, and a cube of label 2 that it lacks altogether.
  const Coord<3> extent{16, 9, 9};
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    const bool bar = c[1] >= 2 && c[1] <= 3 && c[2] >= 2 && c[2] <= 3 && c[0] >= 2 && c[0] <= 13;
    const bool cube = c[0] >= 6 && c[0] <= 7 && c[1] >= 6 && c[1] <= 7 && c[2] >= 5 && c[2] <= 6;
    values[static_cast<std::size_t>(i)] = bar ? 1 : cube ? 2 : 0;
  }
  const auto image = make_label_image(extent, values);
  Mesh<3> mesh = mesh_of(image).mesh;
  ASSERT_EQ(broken_components(image, mesh, 8), 0);
  CellBlock& block = mesh.blocks[0];
  const MaterialId background = 0;
  for (std::int64_t c = 0; c < block.size(); ++c) {
    double x = 0;
    for (int k = 0; k < 4; ++k) x += mesh.points[block.cell(c)[k]][0] / 4;
    MaterialId& m = block.materials[static_cast<std::size_t>(c)];
    if (mesh.labels[m] == 2 || (mesh.labels[m] == 1 && x > 7 && x < 8.5)) m = background;
  }
  ASSERT_EQ(broken_components(image, mesh, 8), 2);
  Execution execution(2);
  const RepairReport report = repair_topology(mesh, image, {}, execution);
  EXPECT_EQ(report.restored, 1);
  EXPECT_GE(report.bridged, 1);
  EXPECT_EQ(std::ranges::count(report.anchors, material_of(image.labels, 2), &Anchor::material), 1);
  EXPECT_EQ(broken_components(image, mesh, 8), 0);
  EXPECT_EQ(pinches(mesh), 0U);
}

}  // namespace
}  // namespace treemarch
