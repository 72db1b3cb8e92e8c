#include "treemarch/pipeline/between_moments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "support/images.h"
#include "treemarch/march/slice_mesh.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

constexpr double kRadius = 5.3;

/// A ball of label 5 that moves by `step` voxels along x from one moment to the next.
LabelImage<4> moving_ball(double step, double time_unit) {
  const Coord<4> extent{18, 14, 14, 4};
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<4> c = coord_of(i, extent);
    const double x = c[0] + 0.5 - 6.3 - step * c[3], y = c[1] + 0.5 - 6.8, z = c[2] + 0.5 - 7.1;
    values.push_back(x * x + y * y + z * z < kRadius * kRadius ? 5 : 0);
  }
  Frame<4> frame;
  frame.spacing[3] = time_unit;
  return make_label_image(extent, values, frame);
}

double volume_of(const Mesh<3>& mesh) {
  double sum = 0;
  for (const CellBlock& block : mesh.blocks)
    for (std::int64_t i = 0; i < block.size(); ++i)
      sum += cell_volume<3>(mesh.points.data(), block.type, block.cell(i));
  return sum;
}

MeshOptions options_of(bool background) {
  MeshOptions options;
  options.method = Method::paper;
  options.keep_background = background;
  return options;
}

TEST(BetweenMoments, TheMeshOfSpaceAndTimeIsValidAndFillsTheBox) {
  for (const double unit : {1.0, 0.4}) {
    const auto image = moving_ball(1.6, unit);
    Execution execution(2);
    const Mesh<4> mesh = mesh_image(image, options_of(true), execution).mesh;
    const MeshDefects defects = validate(mesh, execution);
    EXPECT_TRUE(defects.fills_box()) << unit << defects.describe();
    Vec<4> low = mesh.points[0], high = low;
    for (const Vec<4>& p : mesh.points)
      for (int d = 0; d < 4; ++d) low[d] = std::min(low[d], p[d]), high[d] = std::max(high[d], p[d]);
    EXPECT_EQ(low, Vec<4>{});
    EXPECT_EQ(high, image.size());
  }
}

/// Slices of a moving ball are balls, at the moments and between them, however fast it moves.
TEST(BetweenMoments, SlicesKeepTheVolumeOfWhatMoves) {
  const double ball = 4.0 / 3 * std::numbers::pi * kRadius * kRadius * kRadius;
  for (const double step : {0.0, 0.7, 1.8}) {
    const auto image = moving_ball(step, 1);
    Execution execution(2);
    const MeshResult<4> result = mesh_image(image, options_of(false), execution);
    for (const double moment : {0.0, 0.37, 1.0, 1.5, 2.21, 3.0}) {
      const Mesh<3> slice = slice_mesh<4>(result.mesh, moment + 0.5, execution);
      EXPECT_TRUE(validate(slice, execution).sound()) << step << ' ' << moment;
      const double volume = volume_of(slice);
      EXPECT_NEAR(volume / ball, 1, 0.03) << step << ' ' << moment;
    }
    EXPECT_GT(measure_fidelity(image, result.mesh, 0, execution).labels.back().dice, 0.99) << step;
  }
}

/// What is asked for at a moment holds for the cells before and after it.
TEST(BetweenMoments, SizesAreThoseOfBothMoments) {
  const auto image = moving_ball(2, 1);
  SizingRule rule;
  rule.min_size = 0.5;
  rule.voxel_size.assign(static_cast<std::size_t>(image.voxels.size()), 0);
  const std::int64_t row = image.voxels.size() / 4;
  rule.voxel_size[static_cast<std::size_t>(row + 3)] = 0.25F;  // a corner of the second moment, far from the ball
  const SizingRule found = sizes_between_moments(image, rule, Execution(1));
  ASSERT_EQ(std::ssize(found.voxel_size), 5 * row);
  for (std::int64_t k = 0; k < 5; ++k)
    EXPECT_EQ(found.voxel_size[static_cast<std::size_t>(k * row + 3)], k == 1 || k == 2 ? 0.25F : 0);
  const auto between = between_moments(image, Execution(1));
  for (std::int64_t i = 0; i < 5 * row; ++i) EXPECT_EQ(between.voxels[i], image.voxels[i < 4 * row ? i : i - row]);
}

}  // namespace
}  // namespace treemarch
