#include "treemarch/report/fidelity.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/images.h"
#include "support/voxel_mesh.h"

namespace treemarch {
namespace {

/// A mesh that repeats the image is perfect in every respect.
template <int Dim>
void expect_perfect(const Coord<Dim>& extent, const Frame<Dim>& frame) {
  const auto image = testing::noise_image<Dim>(extent, 5, 3, frame);
  const Execution execution(2);
  const Fidelity f = measure_fidelity(image, testing::voxel_mesh(image), 0, execution);
  ASSERT_EQ(f.labels.size(), image.labels.size());
  std::int64_t voxels = 0;
  for (const LabelFidelity& l : f.labels) {
    EXPECT_EQ(l.dice, 1);
    EXPECT_EQ(l.cells, l.voxels);
    EXPECT_EQ(l.components, l.image_components);
    EXPECT_NEAR(l.volume, l.image_volume, 1e-9 * l.image_volume);
    voxels += l.voxels;
  }
  EXPECT_EQ(voxels, product(extent));
  EXPECT_TRUE(std::ranges::is_sorted(f.labels, {}, &LabelFidelity::label));
  EXPECT_TRUE(f.lost_labels().empty());
  EXPECT_EQ(f.unknown_cells, 0);
}

TEST(Fidelity, AMeshThatRepeatsTheImageIsPerfect) {
  Frame<2> flat;
  flat.spacing = {0.3, 7};
  expect_perfect<2>({31, 17}, flat);
  Frame<3> frame;
  frame.spacing = {0.5, 0.7, 3.1};
  expect_perfect<3>({13, 9, 70}, frame);
}

/// Dice against a count over voxels, for a mesh with some wrong labels.
TEST(Fidelity, CountsWhatDiffers) {
  const auto image = testing::noise_image<3>({8, 9, 10}, 4, 11);
  auto mesh = testing::voxel_mesh(image);
  auto& materials = mesh.blocks[0].materials;
  for (std::size_t i = 0; i < materials.size(); i += 3) materials[i] = (materials[i] + 1) % 4;
  const Execution execution(1);
  const Fidelity f = measure_fidelity(image, mesh, -1, execution);
  for (const LabelFidelity& l : f.labels) {
    std::int64_t both = 0, cells = 0;
    for (std::int64_t v = 0; v < product(image.extent); ++v) {
      const bool in_mesh = mesh.labels[materials[static_cast<std::size_t>(v)]] == l.label;
      cells += in_mesh;
      both += in_mesh && image.labels[image.voxels[v]] == l.label;
    }
    EXPECT_EQ(l.cells, cells);
    EXPECT_DOUBLE_EQ(l.dice, 2.0 * static_cast<double>(both) / static_cast<double>(l.voxels + cells));
  }
}

TEST(Fidelity, NamesLabelsThatAreLostButNotTheBackground) {
  const auto image = make_label_image<2>({3, 1}, {0, 5, -1});
  auto mesh = testing::voxel_mesh(image);
  mesh.labels = {9, 5, -1};  // the cell of label 0 carries another one
  mesh.blocks[0].materials = {0, 1, 1};
  const Execution execution(1);
  const Fidelity f = measure_fidelity(image, mesh, 0, execution);
  EXPECT_EQ(f.lost_labels(), std::vector<std::int32_t>{-1});
  EXPECT_EQ(f.unknown_cells, 1);
}

TEST(Fidelity, DoesNotDependOnThreads) {
  const auto image = testing::noise_image<3>({20, 20, 20}, 6, 5);
  auto mesh = testing::voxel_mesh(image);
  for (auto& p : mesh.points)
    for (double& x : p) x = x * 1.01 + 0.3;  // moved against the voxels
  const Fidelity one = measure_fidelity(image, mesh, 0, Execution(1));
  const Fidelity many = measure_fidelity(image, mesh, 0, Execution(7));
  ASSERT_EQ(one.labels.size(), many.labels.size());
  for (std::size_t i = 0; i < one.labels.size(); ++i) {
    EXPECT_EQ(one.labels[i].dice, many.labels[i].dice);
    EXPECT_EQ(one.labels[i].volume, many.labels[i].volume);
  }
}

}  // namespace
}  // namespace treemarch
