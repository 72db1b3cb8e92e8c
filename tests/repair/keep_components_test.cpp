#include "treemarch/repair/keep_components.h"

#include <gtest/gtest.h>

#include <random>

#include "improve/improve_meshes.h"
#include "treemarch/improve/fit.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/repair/repair_topology.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

/// Labels of smooth noise: many components that meet at corners and edges of voxels, or nearly do.
LabelImage<3> noisy_image(const Coord<3>& extent, int labels, unsigned seed) {
  std::mt19937 random(seed);
  const auto n = static_cast<std::size_t>(product(extent));
  std::vector<std::int32_t> values(n, 0);
  std::vector<double> most(n, -1);
  for (std::int32_t label = 0; label < labels; ++label) {
    std::vector<double> noise(n);
    for (double& x : noise) x = static_cast<double>(random() % 1000);
    for (int pass = 0; pass < 6; ++pass) {  // means of three, twice along each axis
      const std::vector<double> before = noise;
      for (std::size_t i = 0; i < n; ++i) {
        Coord<3> low = coord_of(static_cast<std::int64_t>(i), extent), high = low;
        const int axis = pass % 3;
        low[axis] = std::max(0, low[axis] - 1);
        high[axis] = std::min(extent[axis] - 1, high[axis] + 1);
        noise[i] = (before[linear_index(low, extent)] + before[i] + before[linear_index(high, extent)]) / 3;
      }
    }
    for (std::size_t i = 0; i < n; ++i)
      if (noise[i] > most[i]) most[i] = noise[i], values[i] = label;
  }
  return make_label_image(extent, values);
}

std::vector<ComponentFate> fates_in(const LabelImage<3>& image, const ComponentMap& map, const Mesh<3>& mesh,
                                    Execution& execution) {
  const MeshComponents<3> components(mesh, execution);
  const UniformBlocks<3> uniform(image, execution);
  const PlainBlocks<3> plain(uniform);
  return component_fates(image, map, mesh, components, plain, match_labels(mesh.labels, image.labels), execution).of;
}

/// Components of the image of eight voxels and more: whether each is in one piece.
std::vector<std::uint8_t> are_whole(const LabelImage<3>& image, const Mesh<3>& mesh) {
  Execution execution(2);
  const ComponentMap map = map_components(image, execution);
  const std::vector<ComponentFate> fates = fates_in(image, map, mesh, execution);
  std::vector<std::uint8_t> whole;
  for (std::size_t c = 0; c < fates.size(); ++c)
    if (map.components[c].voxels >= 8) whole.push_back(!fates[c].lost() && !fates[c].split());
  return whole;
}

/// Large moves of large cells break components of such images; with the anchors they break none.
TEST(KeepComponents, MovesBreakNone) {
  std::int64_t broken_alone = 0;
  for (unsigned seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    const auto image = noisy_image({28, 30, 26}, 3, seed);
    MeshOptions options;
    options.sizes.min_size = seed % 2 == 0 ? 3 : 4;
    options.keep_background = true;
    options.quality = 0;
    Execution execution(2);
    const Mesh<3> unmoved = [&] {
      Mesh<3> mesh = mesh_image(image, options, execution).mesh;
      repair_topology(mesh, image, {.rounds = 8}, execution);
      return mesh;
    }();
    Mesh<3> looked_at = unmoved;
    const RepairReport repair = repair_topology(looked_at, image, {.rounds = 0}, execution);
    ASSERT_EQ(looked_at.blocks[0].materials, unmoved.blocks[0].materials);
    ASSERT_TRUE(std::ranges::is_sorted(repair.anchors, {}, &Anchor::point));
    const auto field = build_field<3>(image, {}, execution);
    const auto whole = are_whole(image, unmoved);
    EXPECT_EQ(std::ranges::count(whole, 0), 0);
    const auto broken_by_fit = [&](std::span<const Anchor> anchors) {
      Mesh<3> mesh = unmoved;
      EXPECT_GT(fit_interfaces(mesh, field, image.size(), {.quality = 10, .anchors = anchors}, execution).moves, 1000);
      const auto after = are_whole(image, mesh);
      std::int64_t broken = 0;
      for (std::size_t c = 0; c < whole.size(); ++c) broken += whole[c] > after[c] ? 1 : 0;
      return broken;
    };
    broken_alone += broken_by_fit({});
    EXPECT_EQ(broken_by_fit(repair.anchors), 0);
  }
  EXPECT_GT(broken_alone, 2);
}

TEST(KeepComponents, EachSmallOneHasAnAnchor) {
  // With cells of a voxel most components have vertices inside.
  std::int64_t anchors_of_all = 0;
  for (unsigned seed = 0; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    const auto image = noisy_image({20, 21, 22}, 40, seed);
    const Mesh<3> mesh = testing::cut_image(image).mesh;
    Execution execution(2);
    const ComponentMap map = map_components(image, execution);
    const std::int64_t few = 64 * product(image.extent) / mesh.cell_count();
    const std::vector<ComponentFate> fates = fates_in(image, map, mesh, execution);
    std::vector<std::uint8_t> required(fates.size(), 1), expected(fates.size()), found(fates.size());
    for (std::size_t c = 0; c < fates.size(); ++c) expected[c] = !fates[c].lost() && map.components[c].voxels <= few;
    for (const auto& [cell, a] : keep_small<3>(image, map, required, mesh, execution)) {
      EXPECT_EQ(mesh.blocks[0].materials[cell], a.material);
      const std::int64_t voxel = linear_index(image.voxel_at({a.point[0], a.point[1], a.point[2]}), image.extent);
      EXPECT_EQ(image.voxels[voxel], a.material);
      EXPECT_TRUE(a.inside);
      EXPECT_EQ(found[map.of(voxel)]++, 0);
    }
    EXPECT_EQ(found, expected);
    anchors_of_all += std::ranges::count(found, 1);
  }
  EXPECT_GT(anchors_of_all, 200);
}

TEST(KeepComponents, SmallOnesAreNotLost) {
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
