// The methods of earlier work: what each promises, and what it refuses.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/images.h"
#include "support/surface_error.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

constexpr Method kAll[] = {Method::nielson_sung, Method::nielson_franke, Method::bonnell, Method::hege};

MeshOptions with(Method method) { return {.method = method, .keep_background = true}; }
int most_labels(Method method) { return method == Method::nielson_sung ? 2 : 5; }

template <int Dim>
void expect_fills_box(const LabelImage<Dim>& image, const MeshOptions& options) {
  Execution execution(2);
  const Mesh<Dim> mesh = mesh_image(image, options, execution).mesh;
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  double box = 1;
  for (const double side : image.size()) box *= side;
  EXPECT_NEAR(defects.volume, box, 1e-9 * box);
  EXPECT_EQ(mesh.labels, image.labels);
  Execution one(1);
  const Mesh<Dim> again = mesh_image(image, options, one).mesh;
  EXPECT_EQ(again.points, mesh.points);
  EXPECT_EQ(again.blocks[0].vertices, mesh.blocks[0].vertices);
  EXPECT_EQ(again.blocks[0].materials, mesh.blocks[0].materials);
}

TEST(ReferencePipeline, NoiseFillsTheBox) {
  Frame<2> flat;
  flat.spacing = {0.5, 2};
  for (const Method method : kAll) {
    MeshOptions options = with(method);
    expect_fills_box(testing::noise_image<2>({13, 9}, most_labels(method), 1), options);
    expect_fills_box(testing::noise_image<2>({8, 8}, most_labels(method), 2, flat), options);
    expect_fills_box(testing::noise_image<3>({7, 5, 6}, most_labels(method), 3), options);
    options.smooth = 2;
    options.field = FieldKind::dgf;
    expect_fills_box(testing::noise_image<3>({7, 5, 6}, most_labels(method), 4), options);
    options.balance = kUnbalanced;
    options.pattern = "3";
    expect_fills_box(testing::ball_image<3>({21, 20, 19}, 0.3, 4), options);
  }
}

// Voxel centres are vertices, and a vertex keeps its label: so every voxel does, with any number of labels.
TEST(ReferencePipeline, LabelsAtVerticesAreKept) {
  for (const Method method : {Method::nielson_sung, Method::nielson_franke}) {
    Execution execution(2);
    const auto image = testing::noise_image<3>({8, 7, 9}, most_labels(method), 6);
    const Fidelity f = measure_fidelity(image, mesh_image(image, with(method), execution).mesh, 0, execution);
    for (const LabelFidelity& l : f.labels) EXPECT_EQ(l.dice, 1) << l.label;
  }
}

TEST(ReferencePipeline, BallsKeepTheirVolumeAndFractionsAreSmoother) {
  const testing::Level ball = [](const Vec<3>& x) { return norm(x - Vec<3>{13.2, 12.6, 12.9}) - 8.3; };
  const auto image = testing::voxelised(26, ball);
  Execution execution(2);
  const auto error = [&](Method method) {
    const Mesh<3> mesh = mesh_image(image, with(method), execution).mesh;
    const Fidelity f = measure_fidelity(image, mesh, 0, execution);
    const double loss = method == Method::bonnell ? 0.07 : 0.03;  // fractions by a Gaussian shrink small balls
    for (const LabelFidelity& l : f.labels) EXPECT_NEAR(l.volume / l.image_volume, 1, loss);
    return testing::surface_error(mesh, ball);
  };
  const auto middle = error(Method::nielson_franke);
  EXPECT_EQ(error(Method::nielson_sung).distance, middle.distance) << "labels alone are cut in the middle";
  EXPECT_LT(error(Method::hege).distance, middle.distance);
  EXPECT_LT(error(Method::bonnell).normal, 0.5 * middle.normal);
}

TEST(ReferencePipeline, SizesMatter) {
  Execution execution(2);
  const auto image = testing::ball_image<3>({31, 31, 31}, 0.2, 4);
  for (const Method method : {Method::nielson_sung, Method::nielson_franke, Method::bonnell}) {
    MeshOptions options = with(method);
    const auto cells = [&] { return mesh_image(image, options, execution).mesh.cell_count(); };
    const auto usual = cells();
    options.sizes.max_size = 1;
    EXPECT_GT(cells(), 1.5 * static_cast<double>(usual));
    options.sizes = {.min_size = 2};
    EXPECT_LT(cells(), 0.7 * static_cast<double>(usual));
  }
}

TEST(ReferencePipeline, RefusesWhatItDoesNotDo) {
  const auto image = testing::noise_image<2>({8, 8}, 3, 1);
  Execution execution(1);
  EXPECT_THROW(mesh_image(image, with(Method::nielson_sung), execution), Error);
  const auto refuses = [&](const std::function<void(MeshOptions&)>& change) {
    MeshOptions options = with(Method::nielson_franke);
    change(options);
    EXPECT_THROW(mesh_image(image, options, execution), Error);
  };
  refuses([](MeshOptions& o) { o.snap = 0.2; });
  refuses([](MeshOptions& o) { o.elements = Elements::hybrid; });
  refuses([](MeshOptions& o) { o.order = MaterialOrder::label; });
  refuses([](MeshOptions& o) { o.weights = {1, 2, 3}; });
  refuses([](MeshOptions& o) { o.sizes.interface_size = {{0, 1, 2.0}}; });
  refuses([](MeshOptions& o) { o.closed_border = true; });
  refuses([](MeshOptions& o) { o.field = FieldKind::grey; });
}

}  // namespace
}  // namespace treemarch
