#include "treemarch/repair/strays.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "support/images.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/repair/repair_topology.h"

namespace treemarch {
namespace {

template <int Dim>
Mesh<Dim> mesh_of(const LabelImage<Dim>& image, double size) {
  MeshOptions options;
  options.sizes.min_size = size;
  options.keep_background = true;
  Execution execution(2);
  return mesh_image(image, options, execution).mesh;
}

/// Gives some cells whose corners are all inside one material, and the cell beside half of them, to another material.
template <int Dim>
std::set<CellId> plant(Mesh<Dim>& mesh, unsigned seed) {
  std::mt19937 random(seed);
  CellBlock& block = mesh.blocks[0];
  const MeshComponents<Dim> before(mesh, Execution(2));
  const auto corners = [&](CellId c) { return std::set<VertexId>(block.cell(c), block.cell(c) + Dim + 1); };
  std::set<VertexId> used;
  std::set<CellId> planted;
  for (int tries = 0; tries < 60; ++tries) {
    const auto c = static_cast<CellId>(random() % static_cast<unsigned>(block.size()));
    std::set<VertexId> mine = corners(c);
    std::vector<CellId> cells{c};
    for (CellId o = 0; tries % 2 == 0 && cells.size() < 2 && o < block.size(); ++o) {
      std::size_t shared = 0;
      for (const VertexId v : corners(o)) shared += mine.count(v);
      if (shared == Dim) cells.push_back(o);
    }
    for (const CellId o : cells) mine.merge(corners(o));
    if (std::ranges::any_of(mine, [&](VertexId v) { return !before.is_inner(v) || used.contains(v); })) continue;
    used.insert(mine.begin(), mine.end());
    for (const CellId o : cells) {
      block.materials[o] = (block.materials[o] + 1) % static_cast<MaterialId>(mesh.labels.size());
      planted.insert(o);
    }
  }
  return planted;
}

template <int Dim>
void find_and_remove(const LabelImage<Dim>& image) {
  const Mesh<Dim> original = mesh_of(image, 2);
  Execution execution(2);
  const auto strays = [&](const Mesh<Dim>& mesh) {
    return find_strays<Dim>(image, mesh, MeshComponents<Dim>(mesh, execution), execution);
  };
  ASSERT_TRUE(strays(original).empty());
  for (unsigned seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    Mesh<Dim> mesh = original;
    const std::set<CellId> planted = plant(mesh, seed);
    ASSERT_GE(planted.size(), 5U);
    std::set<CellId> found;
    for (const Stray& stray : strays(mesh)) found.insert(stray.cells.begin(), stray.cells.end());
    EXPECT_EQ(found, planted);
    repair_topology(mesh, image, {}, execution);
    EXPECT_EQ(mesh.blocks[0].materials, original.blocks[0].materials);
  }
}

TEST(strays, what_no_voxel_stands_behind_is_found_and_goes_back) {
  find_and_remove(testing::ball_image<3>({24, 22, 20}, 0.4));
  find_and_remove(testing::ball_image<2>({60, 50}, 0.4));
}

}  // namespace
}  // namespace treemarch
