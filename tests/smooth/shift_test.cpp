#include "treemarch/smooth/shift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/images.h"
#include "support/meshes.h"
#include "support/voxel_mesh.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

template <int Dim>
Mesh<Dim> shifted(const LabelImage<Dim>& image, const ShiftOptions& options, ShiftReport& report, int threads = 2) {
  Execution execution(threads);
  const Field<Dim> field = build_field(image, {}, execution);
  Mesh<Dim> mesh = testing::voxel_mesh(image);
  report = shift_vertices(mesh, field, options, execution);
  return mesh;
}

/// Cells keep their shape as promised and fill the box; only vertices on interfaces move, not far and not off the box.
template <int Dim>
void expect_sound(const LabelImage<Dim>& image, const ShiftOptions& options) {
  ShiftReport report;
  const Mesh<Dim> before = testing::voxel_mesh(image), after = shifted(image, options, report);
  const MeshDefects defects = validate(after, Execution(2));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  const CellBlock& cells = after.blocks[0];
  for (std::int64_t c = 0; c < cells.size(); ++c) {
    std::array<Vec<Dim>, 8> p{};
    for (int k = 0; k < vertex_count(cells.type); ++k) p[k] = after.points[cells.cell(c)[k]];
    ASSERT_GE(corner_jacobians<Dim>(p, cells.type).min_scaled, options.keep - 1e-12);
  }
  std::int64_t moved = 0;
  for (std::size_t v = 0; v < after.points.size(); ++v) {
    moved += after.points[v] != before.points[v];
    for (int d = 0; d < Dim; ++d) {
      const double x = before.points[v][d], side = image.frame.spacing[d];
      ASSERT_LE(std::abs(after.points[v][d] - x), options.most * side * (1 + 1e-9));
      if (x == 0 || x == image.size()[d]) ASSERT_EQ(after.points[v][d], x);
    }
  }
  EXPECT_EQ(moved, report.shifted);
  EXPECT_GT(moved, 0);
  EXPECT_LE(report.shifted, report.vertices);
  ShiftReport again;
  EXPECT_TRUE(testing::same_mesh(after, shifted(image, options, again, 1)));
}

TEST(Shift, CellsStayValid) {
  Frame<3> solid;
  solid.spacing = {0.7, 0.7, 2.5};
  for (const double most : {0.1, 0.3, 0.49})
    for (const int labels : {2, 5}) {
      SCOPED_TRACE(most);
      expect_sound(testing::noise_image<3>({9, 8, 7}, labels, 3), {.most = most});
      expect_sound(testing::noise_image<3>({9, 8, 7}, labels, 3, solid), {.most = most});
      expect_sound(testing::noise_image<2>({23, 17}, labels, 3), {.most = most});
      expect_sound(testing::ball_image<3>({18, 17, 19}, 0.4, labels), {.most = most});
    }
}

TEST(Shift, NothingMovesWithoutInterfacesOrWithoutLeave) {
  ShiftReport report;
  const auto plain = testing::noise_image<3>({5, 4, 3}, 1, 3);
  EXPECT_EQ(shifted(plain, {.most = 0.3}, report).points, testing::voxel_mesh(plain).points);
  EXPECT_EQ(report.vertices, 0);
  const auto noise = testing::noise_image<3>({5, 4, 3}, 3, 3);
  EXPECT_EQ(shifted(noise, {.most = 0}, report).points, testing::voxel_mesh(noise).points);
}

/// RMS distance of the interface's vertices from a ball, in voxels.
double roughness(double most) {
  const auto image = testing::ball_image<3>({32, 32, 32}, 0.36);
  ShiftReport report;
  const Mesh<3> mesh = shifted(image, {.most = most}, report);
  const Mesh<3> plain = testing::voxel_mesh(image);
  const CellBlock& cells = mesh.blocks[0];
  std::vector<std::uint8_t> inside(mesh.points.size(), 0), outside = inside;
  for (std::int64_t c = 0; c < cells.size(); ++c)
    for (int k = 0; k < 8; ++k) (image.labels[cells.materials[c]] ? inside : outside)[cells.cell(c)[k]] = 1;
  double squares = 0;
  std::int64_t count = 0;
  for (std::size_t v = 0; v < inside.size(); ++v) {
    if (!inside[v] || !outside[v]) continue;
    const double r = norm(mesh.points[v] - Vec<3>{16, 16, 16}) - 0.36 * 32;
    squares += r * r;
    ++count;
  }
  return std::sqrt(squares / static_cast<double>(count));
}

TEST(Shift, BallsGetRounder) {
  const double before = roughness(0);
  EXPECT_LT(roughness(0.15), 0.8 * before);
  EXPECT_LT(roughness(0.3), 0.5 * before);
  EXPECT_LT(roughness(0.49), roughness(0.3));
}

}  // namespace
}  // namespace treemarch
