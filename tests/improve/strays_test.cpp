#include "treemarch/improve/strays.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "support/images.h"
#include "treemarch/improve/repair_topology.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

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
  const ComponentMap map = map_components(image, execution);
  const std::vector<std::uint8_t> required(map.components.size(), 1);
  const auto pieces = [&](const Mesh<Dim>& mesh) {
    return find_small_pieces<Dim>(image, map, required, mesh, MeshComponents<Dim>(mesh, execution), execution);
  };
  ASSERT_TRUE(pieces(original).strays.empty());
  for (unsigned seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    Mesh<Dim> mesh = original;
    const std::set<CellId> planted = plant(mesh, seed);
    ASSERT_GE(planted.size(), 5U);
    std::set<CellId> found;
    for (const Stray& stray : pieces(mesh).strays) found.insert(stray.cells.begin(), stray.cells.end());
    EXPECT_EQ(found, planted);
    repair_topology(mesh, image, {}, execution);
    EXPECT_EQ(mesh.blocks[0].materials, original.blocks[0].materials);
  }
}

TEST(strays, what_no_voxel_stands_behind_is_found_and_goes_back) {
  find_and_remove(testing::ball_image<3>({24, 22, 20}, 0.4));
  find_and_remove(testing::ball_image<2>({60, 50}, 0.4));
}

TEST(strays, pieces_with_a_voxel_are_anchored_and_not_lost) {
  // Corners of the box hold two voxels in few cells, and an improvement far beyond the floor moves all it can.
  std::int64_t anchors = 0;
  for (int kind = 0; kind < 24; ++kind) {
    SCOPED_TRACE(kind);
    Coord<3> at{}, extent{4, 5, 6};
    for (int d = 0; d < 3; ++d) at[d] = (kind >> d & 1) != 0 ? extent[d] - 1 : 0;
    Coord<3> beside = at;
    const int axis = kind / 8;
    beside[axis] += at[axis] == 0 ? 1 : -1;
    std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)), 0);
    values[static_cast<std::size_t>(linear_index(at, extent))] = 1;
    values[static_cast<std::size_t>(linear_index(beside, extent))] = 1;
    const auto image = make_label_image(extent, values);
    MeshOptions options;
    options.sizes.min_size = 1;
    options.keep_background = true;
    Execution execution(2);
    for (const double quality : {20.0, 25.0}) {
      options.quality = quality;
      const auto result = mesh_image(image, options, execution);
      anchors += std::ssize(result.guarantee->repair.anchors);
      EXPECT_FALSE(measure_fidelity(image, result.mesh, 0, execution).topology->breached()) << quality;
    }
  }
  EXPECT_GT(anchors, 10);
}

}  // namespace
}  // namespace treemarch
