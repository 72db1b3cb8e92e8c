#include "treemarch/smooth/shift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/images.h"
#include "support/meshes.h"
#include "support/surface_error.h"
#include "support/voxel_mesh.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/interfaces.h"
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
    const CornerJacobians j = corner_jacobians<Dim>(p, cells.type);
    ASSERT_GE(j.min_scaled, options.keep - 1e-12);
    ASSERT_GE(j.ratio(), options.keep_ratio - 1e-12);
  }
  std::int64_t moved = 0;
  for (std::size_t v = 0; v < after.points.size(); ++v) {
    moved += after.points[v] != before.points[v];
    for (int d = 0; d < Dim; ++d) {
      const double x = before.points[v][d], side = image.frame.spacing[d];
      ASSERT_LE(std::abs(after.points[v][d] - x), options.most * side * (1 + 1e-9));
      if (x == 0 || x == image.size()[d]) {
        ASSERT_EQ(after.points[v][d], x);
      }
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

/// RMS distance of the facets of a meshed ball from the ball, over their area, in voxels.
double surface_error(double radius, double most) {
  constexpr std::int32_t kSide = 36;
  const Vec<3> centre{kSide / 2 + 0.17, kSide / 2 + 0.31, kSide / 2 - 0.43};
  const auto image = testing::voxelised(kSide, [&](const Vec<3>& x) { return norm(x - centre) - radius; });
  ShiftReport report;
  const Mesh<3> mesh = shifted(image, {.most = most}, report);
  double squares = 0, total = 0;
  for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, Execution(2)))
    for (std::int64_t i = 0; i < block.size(); ++i) {
      const VertexId* v = block.vertices.data() + i * 4;
      for (const double a : {0.211, 0.789})  // Gauss
        for (const double b : {0.211, 0.789}) {
          const auto between = [&](double t, int j, int k) {
            return (1 - t) * mesh.points[v[j]] + t * mesh.points[v[k]];
          };
          const Vec<3> low = between(a, 0, 1), high = between(a, 3, 2);
          const Vec<3> across = between(b, 1, 2) - between(b, 0, 3);
          const double area = norm(cross(high - low, across)), off = norm((1 - b) * low + b * high - centre) - radius;
          squares += area * off * off;
          total += area;
        }
    }
  return std::sqrt(squares / total);
}

TEST(Shift, BallsGetRounder) {
  for (const double radius : {5.0, 8.3, 14.0}) {
    SCOPED_TRACE(radius);
    const double before = surface_error(radius, 0);
    EXPECT_LT(surface_error(radius, 0.15), 0.75 * before);
    EXPECT_LT(surface_error(radius, 0.3), 0.5 * before);
    EXPECT_LT(surface_error(radius, 0.49), surface_error(radius, 0.3));
  }
}

}  // namespace
}  // namespace treemarch
