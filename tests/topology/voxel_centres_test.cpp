#include "treemarch/topology/voxel_centres.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "support/images.h"
#include "support/voxel_mesh.h"
#include "treemarch/topology/plain_blocks.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<std::int64_t> brute_force(const LabelImage<Dim>& image, const Simplex<Dim>& simplex) {
  std::vector<std::int64_t> found;
  const Barycentric<Dim> barycentric(simplex);
  for (std::int64_t v = 0; v < product(image.extent); ++v) {
    const Vec<Dim> centre = image.centre(coord_of(v, image.extent));
    if (barycentric.is_valid() && barycentric.contains(centre, 1e-9)) found.push_back(v);
  }
  return found;
}

/// Simplices with corners on a lattice, so that many centres lie on their facets, and others.
template <int Dim>
void expect_centres(const Coord<Dim>& extent, const Vec<Dim>& spacing, unsigned seed) {
  Frame<Dim> frame;
  frame.spacing = spacing;
  const auto image = testing::noise_image<Dim>(extent, 2, seed, frame);
  const VoxelCentres<Dim> centres(image);
  std::mt19937 random(seed);
  std::size_t total = 0;
  for (int i = 0; i < 400; ++i) {
    Simplex<Dim> simplex;
    for (Vec<Dim>& x : simplex)
      for (int d = 0; d < Dim; ++d) {
        const auto range = static_cast<unsigned>(2 * (extent[d] + 8));
        x[d] = (0.5 * (random() % range) - 4) * spacing[d];
        if (i % 2) x[d] += 1e-3 * (random() % 1000) * spacing[d];
      }
    if (i % 50 == 0) simplex[Dim] = 0.5 * (simplex[0] + simplex[1]);  // flat
    std::vector<std::int64_t> found;
    centres.visit(
        simplex, [](std::int64_t) { return true; }, [&](std::int64_t v) { found.push_back(v); });
    ASSERT_EQ(found, brute_force(image, simplex)) << i;
    total += found.size();
  }
  EXPECT_GT(total, 1000U);
}

TEST(voxel_centres, are_those_that_each_centre_alone_would_give) {
  expect_centres<3>({17, 12, 14}, {1, 1, 1}, 1);
  expect_centres<3>({9, 21, 6}, {0.3, 0.7, 2.5}, 2);
  expect_centres<2>({60, 41}, {1, 0.4}, 3);
  expect_centres<4>({6, 5, 7, 5}, {1, 1, 2, 1}, 4);
}

/// A mesh of an image of large parts, a voxel too far to one side.
TEST(voxel_centres, of_plain_blocks_are_told_by_the_first) {
  const auto image = testing::ball_image<3>({61, 53, 64}, 0.4);
  Mesh<3> mesh = testing::voxel_mesh(image);
  for (Vec<3>& x : mesh.points) x[1] += 1;
  const Execution execution(3);
  const UniformBlocks<3> uniform(image, execution);
  const MeshComponents<3> components(mesh, execution);
  const PlainBlocks<3> plain(image, uniform, mesh, components.facets(), execution);
  const VoxelCentres<3> centres(image);
  // What the mesh says about each voxel, one by one and by blocks: its material and how often.
  std::vector<int> one(static_cast<std::size_t>(product(image.extent))), all = one;
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t c = 0; c < block.size(); ++c)
    for_each_simplex(mesh, block, c, [&](const Simplex<3>& simplex) {
      const auto use = [&](std::vector<int>& of) {
        return [&, c](std::int64_t v) { of[static_cast<std::size_t>(v)] |= 1 << block.materials[c]; };
      };
      const auto any = [](std::int64_t) { return true; };
      centres.visit(simplex, any, use(one));
      centres.visit(
          simplex, plain.extent(), [&](std::int64_t b) { return plain[b] ? Look::at_first : Look::at_all; }, any,
          use(all));
    });
  std::int64_t plain_blocks = 0;
  for (std::int64_t b = 0; b < plain.size(); ++b) {
    const VoxelBox<3> box = voxels_of_block(coord_of(b, plain.extent()), image.extent);
    const auto first = static_cast<std::size_t>(linear_index(box.begin, image.extent));
    plain_blocks += plain[b];
    for_each_row(box, image.extent, [&](const Coord<3>& row, std::int64_t at) {
      for (auto v = static_cast<std::size_t>(at); v < static_cast<std::size_t>(at + box.end[0] - row[0]); ++v) {
        ASSERT_EQ(one[v], all[plain[b] ? first : v]);
        if (plain[b]) {
          ASSERT_EQ(image.voxels[static_cast<std::int64_t>(v)], plain.material(b));
        }
      }
    });
  }
  EXPECT_GT(plain_blocks, plain.size() / 3);
  EXPECT_LT(plain_blocks, plain.size());
}

}  // namespace
}  // namespace treemarch
