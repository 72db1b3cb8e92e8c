// The paper's method as a whole: its separating functions and the order of materials.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "support/images.h"
#include "support/surface_error.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {
namespace {

using testing::Level;
using testing::surface_error;

const Level kBall = [](const Vec<3>& x) { return norm(x - Vec<3>{14.2, 15.1, 14.9}) - 9.3; };

MeshOptions paper(std::optional<FieldKind> field = {}) {
  return {.method = Method::paper, .sizes = {.min_size = 1}, .field = field, .keep_background = true};
}

// What the page on fields says of them holds for this method too: the smoother ones give the smoother ball.
TEST(PaperPipeline, SmootherFieldsGiveSmootherSurfaces) {
  Execution execution(2);
  const auto image = testing::voxelised(30, kBall);
  MeshOptions options = paper();
  options.smooth = 0;
  double last = 90;
  for (const FieldKind field : {FieldKind::solid_angle, FieldKind::bspline3, FieldKind::dgf}) {
    options.field = field;
    const Mesh<3> mesh = mesh_image(image, options, execution).mesh;
    EXPECT_TRUE(validate(mesh, execution).fills_box());
    const auto error = surface_error(mesh, kBall);
    EXPECT_LT(error.distance, 0.15);
    EXPECT_LT(error.normal, 0.95 * last);
    last = error.normal;
  }
  EXPECT_LT(last, 7);
}

// On voxels of a lattice of voxels solid angles and the d-linear function are the same numbers at all vertices.
TEST(PaperPipeline, SolidAnglesOfVoxelsAreTheLinearFunction) {
  Execution execution(2);
  MeshOptions options = paper(FieldKind::linear);
  options.smooth = 0;
  options.snap = 0;
  options.sizes.max_size = 1;
  const auto image = testing::ball_image<2>({21, 20}, 0.37, 3);
  const Mesh<2> linear = mesh_image(image, options, execution).mesh;
  options.field = FieldKind::solid_angle;
  const Mesh<2> angles = mesh_image(image, options, execution).mesh;
  ASSERT_EQ(linear.points.size(), angles.points.size());
  EXPECT_EQ(linear.blocks[0].vertices, angles.blocks[0].vertices);
  EXPECT_EQ(linear.blocks[0].materials, angles.blocks[0].materials);
  for (std::size_t v = 0; v < linear.points.size(); ++v)
    EXPECT_LT(norm(linear.points[v] - angles.points[v]), 1e-6) << "weights are fixed point";
}

TEST(PaperPipeline, GreyValuesPlaceTheSurfaceBetweenVoxels) {
  Execution execution(2);
  const auto image = testing::voxelised(30, kBall);
  GreyInput<3> grey{{}, 100};
  grey.image.extent = image.extent;
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    const Coord<3> c = coord_of(i, image.extent);
    const double d = kBall({c[0] + 0.5, c[1] + 0.5, c[2] + 0.5});
    grey.image.values.push_back(static_cast<float>(100 - 100 * std::clamp(d, -2.0, 2.0)));
  }
  const auto error = [&](const MeshOptions& options) {
    const Mesh<3> mesh = mesh_image(image, options, execution, &grey).mesh;
    EXPECT_TRUE(validate(mesh, execution).fills_box());
    return surface_error(mesh, kBall).distance;
  };
  MeshOptions options = paper(FieldKind::solid_angle);
  options.smooth = 0;
  const double plain = error(options);
  options.field.reset();  // grey, since there is a grey image
  EXPECT_LT(error(options), 0.5 * plain);
  options.snap = 0;
  EXPECT_LT(error(options), 0.5 * plain);
}

TEST(PaperPipeline, TheOrderCountsWithThreeMaterials) {
  Execution execution(2);
  const auto image = testing::noise_image<3>({9, 9, 9}, 4, 6);
  MeshOptions options = paper();
  const auto cells = [&] { return mesh_image(image, options, execution).mesh.blocks[0].vertices; };
  const auto largest = cells();
  options.order = MaterialOrder::smallest;
  const auto smallest = cells();
  EXPECT_NE(smallest, largest);
  // The same order by name.
  std::vector<std::int64_t> voxels(image.labels.size());
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) ++voxels[image.voxels[i]];
  options.first.resize(voxels.size());
  std::iota(options.first.begin(), options.first.end(), 0U);
  std::ranges::stable_sort(options.first, std::greater<>(), [&](MaterialId m) { return voxels[m]; });
  EXPECT_EQ(cells(), largest);
  std::ranges::reverse(options.first);
  EXPECT_EQ(cells(), smallest);
}

}  // namespace
}  // namespace treemarch
