// Layers of two voxels between two materials, as a skull is: closed for any size of cells, and two cells thick on
// demand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "support/surface_error.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {
namespace {

using testing::Level;

/// Label 1 below the layer, 2 in it, 3 above it; two voxels thick.
LabelImage<3> layered(const Coord<3>& extent, const Level& distance) {
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    const double d = distance({c[0] + 0.5, c[1] + 0.5, c[2] + 0.5});
    values.push_back(d < -1 ? 1 : d < 1 ? 2 : 3);
  }
  return make_label_image(extent, values);
}

struct Crossing {
  std::int64_t open = 0;    ///< vertices that both sides have
  std::int64_t across = 0;  ///< cells of the layer that touch both sides, be it in a vertex
  std::int64_t cells = 0;   ///< of the layer
};

/// Where no cell of the layer touches both sides, every way through it has two cells at least.
Crossing crossing(const Mesh<3>& mesh) {
  std::vector<int> around(mesh.points.size(), 0);  // one bit a label
  const CellBlock& block = mesh.blocks[0];
  const auto label = [&](std::int64_t c) { return mesh.labels[block.materials[c]]; };
  for (std::int64_t c = 0; c < block.size(); ++c)
    for (int k = 0; k < 4; ++k) around[block.cell(c)[k]] |= 1 << label(c);
  constexpr int kBelow = 1 << 1, kAbove = 1 << 3, kSides = kBelow | kAbove;
  Crossing result;
  result.open = std::ranges::count_if(around, [](int a) { return (a & kSides) == kSides; });
  for (std::int64_t c = 0; c < block.size(); ++c) {
    if (label(c) != 2) continue;
    int touched = 0;
    for (int k = 0; k < 4; ++k) touched |= around[block.cell(c)[k]];
    result.across += (touched & kSides) == kSides;
    ++result.cells;
  }
  return result;
}

void expect_closed(const Coord<3>& extent, const Level& distance) {
  Execution execution(2);
  const auto image = layered(extent, distance);
  MeshOptions options;
  options.keep_background = true;
  std::int64_t across = 0;
  for (const Detail detail : {Detail::coarse, Detail::normal}) {
    options.detail = detail;
    const Crossing found = crossing(mesh_image(image, options, execution).mesh);
    EXPECT_EQ(found.open, 0) << "detail " << static_cast<int>(detail);
    EXPECT_GT(found.cells, 0);
    across += found.across;
  }
  EXPECT_GT(across, 0) << "this layer tells nothing about --layers";
  for (const double tolerance : {0.0, 0.5}) {
    options.detail = Detail::normal;
    options.sizes.tolerance = tolerance;
    options.sizes.layers = 2;
    const Crossing found = crossing(mesh_image(image, options, execution).mesh);
    EXPECT_EQ(found.open, 0) << "tolerance " << tolerance;
    EXPECT_EQ(found.across, 0) << "tolerance " << tolerance << ", of " << found.cells;
  }
}

TEST(thin_layers, shells_of_any_radius_and_place) {
  std::mt19937 random(3);
  for (const double r : {6.0, 9.5, 14.0}) {
    const auto side = static_cast<std::int32_t>(2 * r + 8);
    Vec<3> centre;
    for (double& x : centre) x = side / 2.0 + static_cast<double>(random() % 100) / 100 - 0.5;
    SCOPED_TRACE(r);
    expect_closed({side, side, side}, [=](const Vec<3>& x) { return norm(x - centre) - r; });
  }
}

TEST(thin_layers, slabs_of_any_direction) {
  std::mt19937 random(5);
  for (int i = 0; i < 6; ++i) {
    Vec<3> normal;
    for (double& x : normal) x = static_cast<double>(random() % 200) / 100 - 1;
    normal = (1 / norm(normal)) * normal;
    SCOPED_TRACE(i);
    expect_closed({20, 18, 16}, [=](const Vec<3>& x) { return dot(normal, x - Vec<3>{10.2, 9.1, 7.9}); });
  }
}

}  // namespace
}  // namespace treemarch
