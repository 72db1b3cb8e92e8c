#include "treemarch/topology/pinches.h"

#include <gtest/gtest.h>

#include <set>

#include "support/images.h"
#include "support/voxel_mesh.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<ImagePinch> pinches_of(const LabelImage<Dim>& image, int threads) {
  const Execution execution(threads);
  return find_image_pinches(image, UniformBlocks<Dim>(image, execution), execution);
}

/// The mesh that repeats an image is pinched where the image is.
template <int Dim>
void expect_as_in_image(const LabelImage<Dim>& image) {
  const Mesh<Dim> mesh = testing::voxel_mesh(image);  // its vertices are the corners of the voxels
  std::set<std::pair<std::int64_t, MaterialId>> in_image, in_mesh;
  for (const ImagePinch& p : pinches_of(image, 3)) in_image.emplace(p.corner, p.material);
  const MeshComponents<Dim> components(mesh, Execution(3));
  for (const MeshPinch& p : components.pinches()) in_mesh.emplace(p.vertex, p.material);
  EXPECT_EQ(in_image, in_mesh);
}

TEST(pinches, of_an_image_and_of_the_mesh_that_repeats_it_agree) {
  std::size_t total = 0;
  for (unsigned seed = 0; seed < 8; ++seed) {
    const int labels = 2 + static_cast<int>(seed % 5);
    const auto solid = testing::noise_image<3>({9, 11, 7}, labels, seed);
    const auto flat = testing::noise_image<2>({17, 13}, labels, seed);
    expect_as_in_image(solid);
    expect_as_in_image(flat);
    total += pinches_of(solid, 1).size();
  }
  EXPECT_GT(total, 100U);
}

LabelImage<3> voxels(const std::vector<Coord<3>>& ones) {
  std::vector<std::int32_t> values(4 * 4 * 4);
  for (const Coord<3>& c : ones) values[static_cast<std::size_t>(linear_index(c, Coord<3>{4, 4, 4}))] = 1;
  return make_label_image(Coord<3>{4, 4, 4}, values);
}

TEST(pinches, are_found_along_edges_in_points_and_between_nothing_else) {
  const auto count = [](const std::vector<Coord<3>>& ones) { return pinches_of(voxels(ones), 1).size(); };
  EXPECT_EQ(count({{1, 1, 1}}), 0U);
  EXPECT_EQ(count({{1, 1, 1}, {2, 1, 1}, {2, 2, 1}}), 0U);
  EXPECT_EQ(count({{1, 1, 1}, {2, 2, 1}}), 4U);  // both materials at both ends of the edge
  EXPECT_EQ(count({{1, 1, 1}, {2, 2, 2}}), 2U);  // both materials at the corner
  EXPECT_EQ(count({{0, 0, 0}, {1, 1, 0}}), 4U);  // on the side of the box too
}

TEST(pinches, do_not_depend_on_the_number_of_threads) {
  const auto image = testing::noise_image<3>({21, 18, 17}, 3, 4);
  const Mesh<3> mesh = testing::voxel_mesh(image);
  const std::vector<MeshPinch> one = MeshComponents<3>(mesh, Execution(1)).pinches(),
                               many = MeshComponents<3>(mesh, Execution(7)).pinches();
  ASSERT_EQ(one.size(), many.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].vertex, many[i].vertex);
    EXPECT_EQ(one[i].material, many[i].material);
    EXPECT_EQ(one[i].sheets, many[i].sheets);
  }
}

}  // namespace
}  // namespace treemarch
