// The default method as a whole: true to shapes that are known, and what its options do.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "support/images.h"
#include "support/surface_error.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

using testing::Level;
using testing::surface_error;
using testing::SurfaceError;
using testing::voxelised;

MeshOptions one_voxel() {
  MeshOptions options;
  options.sizes.min_size = 1;
  options.keep_background = true;
  return options;
}

void expect_true_to(std::int32_t side, const Level& distance) {
  Execution execution(2);
  const auto result = mesh_image(voxelised(side, distance), one_voxel(), execution);
  const SurfaceError error = surface_error(result.mesh, distance);
  EXPECT_LE(error.distance, 0.12);
  EXPECT_LE(error.normal, 6);
  const MeshQuality quality = measure_quality(result.mesh, {}, 1, execution);
  EXPECT_GE(quality.angles.min, 20);
  EXPECT_LE(quality.angles.max, 155);
}

TEST(guaranteed_pipeline, balls_are_round) {
  for (const double r : {6.0, 12.3, 40.0}) {
    SCOPED_TRACE(r);
    const auto side = static_cast<std::int32_t>(2 * r + 14);
    const Vec<3> centre{side / 2 + 0.13, side / 2 + 0.31, side / 2 - 0.22};
    expect_true_to(side, [=](const Vec<3>& x) { return norm(x - centre) - r; });
  }
}

TEST(guaranteed_pipeline, ellipsoid_and_torus_are_smooth) {
  const Vec<3> axes{16, 11, 8};
  expect_true_to(44, [&](const Vec<3>& x) {  // first-order distance
    double f = 0;
    Vec<3> gradient{};
    for (int d = 0; d < 3; ++d) {
      const double u = (x[d] - 22.1) / axes[d];
      f += u * u;
      gradient[d] = u / axes[d];
    }
    const double root = std::sqrt(f);
    return root == 0 ? -8 : (root - 1) * root / norm(gradient);
  });
  expect_true_to(48, [](const Vec<3>& x) {
    const Vec<3> axis = (1 / std::sqrt(14.0)) * Vec<3>{1, 2, 3};
    const Vec<3> y = x - Vec<3>{24.2, 23.9, 24.1};
    const double along = dot(y, axis), across = std::sqrt(std::max(0.0, squared_norm(y) - along * along));
    return std::hypot(across - 13, along) - 4;
  });
}

TEST(guaranteed_pipeline, normals_get_no_worse_as_cells_shrink) {
  Execution execution(2);
  for (const double radius : {8.3, 16.1}) {
    const auto side = static_cast<std::int32_t>(2 * radius + 14);
    const Vec<3> centre{side / 2 + 0.13, side / 2 + 0.31, side / 2 - 0.22};
    const Level distance = [=](const Vec<3>& x) { return norm(x - centre) - radius; };
    const auto image = voxelised(side, distance);
    MeshOptions options = one_voxel();
    double before = 8;  // degrees, RMS
    for (const double size : {4.0, 2.0, 1.0, 0.5}) {
      SCOPED_TRACE(::testing::Message() << "radius " << radius << ", cells of " << size);
      options.sizes.min_size = size;
      const SurfaceError error = surface_error(mesh_image(image, options, execution).mesh, distance);
      EXPECT_LE(error.normal, before);
      EXPECT_LE(error.distance, size == 4 ? 0.22 : 0.12);  // of vertices: large facets are on the sphere on average
      // Small cells have the field's own error, cells of a voxel average it a little.
      before = 1.03 * error.normal;
    }
  }
}

TEST(guaranteed_pipeline, quality_zero_leaves_the_cut_as_it_is) {
  Execution execution(2);
  const auto image = testing::noise_image<3>({20, 18, 16}, 5, 3);
  MeshOptions options = one_voxel();
  const auto improved = mesh_image(image, options, execution);
  options.quality = 0;
  const auto cut = mesh_image(image, options, execution);
  EXPECT_EQ(cut.guarantee->improve.stopped, ImproveStop::off);
  EXPECT_GE(measure_quality(cut.mesh, image.frame, 1, execution).angles.min, 18);
  EXPECT_LT(measure_quality(cut.mesh, image.frame, 1, execution).angles.min, 20);
  EXPECT_GE(measure_quality(improved.mesh, image.frame, 1, execution).angles.min, 20);
}

TEST(guaranteed_pipeline, closed_border_rounds_what_touches_the_side) {
  Execution execution(2);
  const auto image = voxelised(16, [](const Vec<3>& x) { return std::hypot(x[1] - 8, x[2] - 8) - 4; });
  MeshOptions options = one_voxel();
  options.keep_background = false;
  const auto extent_of = [](const Mesh<3>& mesh) {
    double low = 1e9, high = -1e9;
    for (const auto& p : mesh.points) low = std::min(low, p[0]), high = std::max(high, p[0]);
    return std::pair(low, high);
  };
  const auto flat = mesh_image(image, options, execution);
  EXPECT_EQ(extent_of(flat.mesh), std::pair(0.0, 16.0));
  std::int64_t on_side = 0;
  for (const auto& p : flat.mesh.points) on_side += p[0] == 0;
  EXPECT_GT(on_side, 20);
  options.closed_border = true;
  const auto closed = mesh_image(image, options, execution);
  const auto [low, high] = extent_of(closed.mesh);
  EXPECT_NEAR(low, 0, 0.6);
  EXPECT_NEAR(high, 16, 0.6);
  EXPECT_TRUE(validate(closed.mesh, execution).sound());
  EXPECT_EQ(closed.mesh.labels, image.labels);
  EXPECT_GT(measure_fidelity(image, closed.mesh, 0, execution).mean_dice(), 0.9);
}

TEST(guaranteed_pipeline, borders_are_those_of_the_mesh) {
  const LabelImage<3> image = testing::noise_image<3>({15, 14, 12}, 3, 3);
  Execution execution(2);
  const auto meshed = [&](const std::function<void(MeshOptions&)>& change) {
    MeshOptions options;
    options.sizes.min_size = 3;
    change(options);
    return mesh_image(image, options, execution);
  };
  for (const bool closed : {false, true})
    for (const bool keep : {false, true}) {
      const MeshResult<3> result = meshed([&](MeshOptions& o) {
        o.closed_border = closed;
        o.keep_background = keep;
      });
      ASSERT_TRUE(result.borders);
      const Borders expected = find_borders(result.mesh, execution);
      EXPECT_EQ(result.borders->vertices, expected.vertices);
      ASSERT_EQ(result.borders->facets.size(), expected.facets.size());
      for (std::size_t i = 0; i < expected.facets.size(); ++i) {
        EXPECT_EQ(result.borders->facets[i].own.cell, expected.facets[i].own.cell);
        EXPECT_EQ(result.borders->facets[i].own.facet, expected.facets[i].own.facet);
        EXPECT_EQ(result.borders->facets[i].beyond.cell, expected.facets[i].beyond.cell);
      }
    }
  EXPECT_FALSE(meshed([](MeshOptions& o) { o.elements = Elements::hybrid; }).borders);
  EXPECT_FALSE(meshed([](MeshOptions& o) { o.sizes.min_size = 1; }).borders);
}

TEST(guaranteed_pipeline, grey_values_place_the_surface_between_voxels) {
  const Vec<3> centre{15.2, 16.1, 15.9};
  const Level ball = [&](const Vec<3>& x) { return norm(x - centre) - 10.3; };
  GreyInput<3> grey;
  grey.image.extent = {32, 32, 32};
  grey.threshold = 100;
  std::vector<std::int32_t> labels;
  for (std::int64_t i = 0; i < 32 * 32 * 32; ++i) {
    const Coord<3> c = coord_of(i, grey.image.extent);
    const double d = ball({c[0] + 0.5, c[1] + 0.5, c[2] + 0.5});
    grey.image.values.push_back(static_cast<float>(100 - 100 * std::clamp(d, -1.0, 1.0)));
    labels.push_back(grey.image.values.back() >= 100);
  }
  Execution execution(2);
  const auto image = make_label_image(grey.image.extent, labels);
  const double plain = surface_error(mesh_image(image, one_voxel(), execution).mesh, ball).distance;
  const double by_grey = surface_error(mesh_image(image, one_voxel(), execution, &grey).mesh, ball).distance;
  EXPECT_LT(by_grey, 0.5 * plain);
}

TEST(guaranteed_pipeline, options_that_cannot_be_kept_are_refused) {
  Execution execution(2);
  const auto image = testing::noise_image<3>({8, 8, 8}, 2, 3);
  const auto refused = [&](auto&& change) {
    MeshOptions options;
    change(options);
    EXPECT_THROW(mesh_image(image, options, execution), Error);
  };
  refused([](MeshOptions& o) { o.quality_floor = 19; });
  refused([](MeshOptions& o) { o.quality = 50; });
  refused([](MeshOptions& o) { o.field = FieldKind::grey; });
  refused([](MeshOptions& o) { o.sigma = 0; });
  refused([](MeshOptions& o) { o.method = Method::paper, o.closed_border = true; });
}

TEST(guaranteed_pipeline, stretched_cells_are_reported_and_keep_their_own_floor) {
  // So few cells that no size comes close to cubes.
  Frame<3> frame;
  frame.spacing = {1, 0.9, 1.1};
  const std::vector<std::int32_t> values{0, 1, 1, 0, 1, 0, 0, 1, 1, 1, 0, 0, 1, 0, 0, 1, 1, 0};
  const auto image = make_label_image(Coord<3>{2, 3, 3}, values, frame);
  MeshOptions options;
  options.sizes.min_size = 1.1;
  options.keep_background = true;
  std::vector<std::string> warnings;
  Execution execution(2);
  execution.on_warning = [&](std::string_view text) { warnings.emplace_back(text); };
  const auto result = mesh_image(image, options, execution);
  EXPECT_EQ(warnings.size(), 1U);
  EXPECT_LT(result.guarantee->quality_floor, 18);
  EXPECT_GE(measure_quality(result.mesh, frame, 1, execution).angles.min, result.guarantee->quality_floor);
}

}  // namespace
}  // namespace treemarch
