#include "treemarch/topology/component_fates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "support/images.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/topology/marked_blocks.h"
#include "treemarch/topology/simplices.h"

namespace treemarch {
namespace {

/// A mesh of an image of noise, of cells so large that it loses and splits components, and what is found about it.
template <int Dim>
struct Case {
  LabelImage<Dim> image;
  Mesh<Dim> mesh;
  ComponentMap map;
  std::vector<MaterialId> same;
  Execution execution{2};

  Case(int side, int labels, unsigned seed, double cells) {
    Coord<Dim> extent;
    extent.fill(side);
    image = testing::noise_image<Dim>(extent, labels, seed);
    MeshOptions options;
    options.sizes.min_size = options.sizes.max_size = cells;
    options.keep_background = true;
    mesh = mesh_image(image, options, execution).mesh;
    // Most of the image is plain, so that blocks and groups of cells can be passed over.
    for (std::int64_t i = 0; i < image.voxels.size(); ++i)
      if (coord_of(i, extent)[0] > 6) image.voxels.set(i, 0);
    map = map_components(image, execution);
    same.resize(image.labels.size());
    std::iota(same.begin(), same.end(), 0U);
  }
};

/// Whether a simplex contains the centre of a voxel.
template <int Dim>
bool contains(const Case<Dim>& given, const Simplex<Dim>& simplex, std::int64_t voxel) {
  const Barycentric<Dim> barycentric(simplex);
  return barycentric.is_valid() && barycentric.contains(given.image.centre(coord_of(voxel, given.image.extent)), 1e-9);
}

template <int Dim>
void expect_what_a_look_at_everything_finds(int side, int labels, unsigned seed, double cells) {
  const Case<Dim> given(side, labels, seed, cells);
  const MeshComponents<Dim> components(given.mesh, given.execution);
  const UniformBlocks<Dim> uniform(given.image, given.execution);
  const PlainBlocks<Dim> plain(given.image, uniform, given.mesh, components.facets(), given.execution);
  const ComponentFates fates =
      component_fates(given.image, given.map, given.mesh, components, plain, given.same, given.execution);

  std::vector<std::set<std::uint32_t>> met(given.map.components.size()), of_material(given.image.labels.size());
  const CellBlock& block = given.mesh.blocks[0];
  for (std::int64_t c = 0; c < block.size(); ++c) {
    of_material[block.materials[c]].insert(components.of(0, c));
    for_each_simplex(given.mesh, block, c, [&](const Simplex<Dim>& simplex) {
      for (std::int64_t v = 0; v < given.image.voxels.size(); ++v)
        if (given.image.voxels[v] == block.materials[c] && contains(given, simplex, v))
          met[given.map.of(v)].insert(components.of(0, c));
    });
  }
  int lost = 0, split = 0;
  for (std::size_t c = 0; c < met.size(); ++c) {
    lost += met[c].empty();
    split += met[c].size() > 1;
    ASSERT_EQ(fates.of[c].lost(), met[c].empty());
    ASSERT_EQ(fates.of[c].split(), met[c].size() > 1);
    const MaterialId m = given.map.components[c].material;
    if (of_material[m].size() < 2) continue;
    EXPECT_EQ(fates.in_main[c] != 0, met[c].contains(fates.main[m]));
    if (met[c].empty()) continue;
    EXPECT_EQ(fates.of[c].first, *met[c].begin());
    EXPECT_EQ(fates.of[c].last, *met[c].rbegin());
  }
  EXPECT_GT(lost + split, 0);

  std::vector<std::int64_t> listed, expected;
  for (const CellPlace& place : fates.elsewhere) listed.push_back(place.cell);
  for (std::int64_t c = 0; c < block.size(); ++c) {
    const MaterialId m = block.materials[c];
    if (of_material[m].size() > 1 && components.of(0, c) != fates.main[m]) expected.push_back(c);
  }
  EXPECT_EQ(listed, expected);
  for (std::size_t m = 0; m < of_material.size(); ++m)
    EXPECT_TRUE(fates.main[m] == ComponentFate::kNone || of_material[m].contains(fates.main[m]));
}

TEST(component_fates, are_those_that_a_look_at_everything_finds) {
  for (unsigned seed = 0; seed < 2; ++seed) {
    SCOPED_TRACE(seed);
    expect_what_a_look_at_everything_finds<2>(40, 2 + static_cast<int>(seed), seed, 1);
    expect_what_a_look_at_everything_finds<2>(40, 2 + static_cast<int>(seed), seed, 4);
    expect_what_a_look_at_everything_finds<3>(14, 2 + static_cast<int>(seed), seed, 2);
    expect_what_a_look_at_everything_finds<3>(18, 2 + static_cast<int>(seed), seed, 5);
  }
}

TEST(marked_blocks, pass_over_no_cell_with_a_voxel_in_question) {
  const Case<3> given(18, 3, 7, 2);
  std::vector<std::uint8_t> wanted(given.map.components.size());
  for (std::size_t c = 0; c < wanted.size(); c += 40) wanted[c] = given.map.components[c].voxels < 100;
  const MarkedBlocks<3> blocks(given.image, given.map, wanted, given.execution);
  const CellBlock& cells = given.mesh.blocks[0];
  std::int64_t passed_over = 0;
  for (std::int64_t c = 0; c < cells.size(); ++c) {
    const bool touched = blocks.touch(given.mesh, cells, c, c + 1);
    passed_over += !touched;
    if (touched) continue;
    for_each_simplex(given.mesh, cells, c, [&](const Simplex<3>& simplex) {
      for (std::int64_t v = 0; v < given.image.voxels.size(); ++v)
        ASSERT_FALSE(wanted[given.map.of(v)] != 0 && contains(given, simplex, v));
    });
  }
  EXPECT_GT(passed_over, cells.size() / 4);
  EXPECT_LT(passed_over, cells.size());
}

}  // namespace
}  // namespace treemarch
