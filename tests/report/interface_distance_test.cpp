#include "treemarch/report/interface_distance.h"

#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <random>

#include "support/images.h"
#include "support/voxel_mesh.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<InterfaceFidelity> measured(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, int threads = 2) {
  std::vector<MaterialId> same(image.labels.size());
  std::iota(same.begin(), same.end(), 0U);
  const Execution execution(threads);
  return measure_interfaces<Dim>(image, mesh, same, 0, MeshComponents<Dim>(mesh, execution).facets(), execution);
}

template <int Dim>
void expect_voxel_faces(const LabelImage<Dim>& image) {
  std::map<std::pair<std::int32_t, std::int32_t>, double> area;
  double voxel = 1;
  for (const double h : image.frame.spacing) voxel *= h;
  for (std::int64_t i = 0; i < product(image.extent); ++i)
    for (int d = 0; d < Dim; ++d) {
      Coord<Dim> c = coord_of(i, image.extent);
      const std::int32_t a = image.labels[image.material(c)];
      if (++c[d] == image.extent[d]) continue;
      const std::int32_t b = image.labels[image.material(c)];
      if (a != b) area[{std::min(a, b), std::max(a, b)}] += voxel / image.frame.spacing[d];
    }
  const auto found = measured(image, testing::voxel_mesh(image));
  ASSERT_EQ(found.size(), area.size());
  for (const InterfaceFidelity& f : found) {
    EXPECT_NEAR(f.area, (area[{f.first, f.second}]), 1e-9 * f.area);
    EXPECT_EQ(f.max, 0);
    EXPECT_EQ(f.rms, 0);
    EXPECT_EQ(f.far_area, 0);
  }
}

TEST(interface_distance, of_the_mesh_that_repeats_the_image_is_none) {
  Frame<3> frame;
  frame.spacing = {0.7, 1.5, 3};
  expect_voxel_faces(testing::noise_image<3>({9, 7, 8}, 4, 3, frame));
  expect_voxel_faces(testing::noise_image<2>({19, 17}, 5, 3));
}

TEST(interface_distance, follows_a_mesh_that_is_moved) {
  const Coord<3> extent{8, 7, 6};
  std::mt19937 random(11);
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<3> c = coord_of(i, extent);
    bool inside = true;
    for (int d = 0; d < 3; ++d) inside &= c[d] > 0 && c[d] + 1 < extent[d];
    values.push_back(inside ? static_cast<std::int32_t>(random() % 5) : 0);
  }
  const auto image = make_label_image(extent, values);
  // The mesh of the same voxels, moved by a part of a voxel.
  Mesh<3> mesh = testing::voxel_mesh(image);
  for (auto& p : mesh.points) p = p + Vec<3>{0.31, -0.24, 0.12};
  const auto found = measured(image, mesh);
  for (const InterfaceFidelity& f : found) EXPECT_LE(f.max, norm(Vec<3>{0.31, -0.24, 0.12}) + 1e-12);
  const auto balls = testing::ball_image<3>({20, 20, 20}, 0.3);
  Mesh<3> shifted = testing::voxel_mesh(balls);
  for (auto& p : shifted.points) p[2] += 0.25;
  const auto one = measured(balls, shifted);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_NEAR(one[0].max, 0.25, 1e-12);  // the poles
  EXPECT_GT(one[0].rms, 0.1);
  EXPECT_LT(one[0].rms, 0.25);
}

TEST(interface_distance, tells_facets_between_labels_that_do_not_touch) {
  const std::vector<std::int32_t> bands{1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3};
  const auto image = make_label_image(Coord<2>{16, 1}, bands);
  Mesh<2> mesh = testing::voxel_mesh(image);
  for (std::size_t c = 6; c < 12; ++c) mesh.blocks[0].materials[c] = c < 9 ? 0 : 2;  // 1 and 3 touch in the mesh
  const auto found = measured(image, mesh);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].first, 1);
  EXPECT_EQ(found[0].second, 3);
  EXPECT_EQ(found[0].far_area, found[0].area);
}

}  // namespace
}  // namespace treemarch
