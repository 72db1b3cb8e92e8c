#include "treemarch/pipeline/mesh_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <random>

#include "support/images.h"
#include "support/meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/report/fidelity.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

template <int Dim>
Mesh<Dim> meshed(const LabelImage<Dim>& image, const MeshOptions& options, int threads = 2) {
  Execution execution(threads);
  return mesh_image(image, options, execution).mesh;
}

/// What holds for every image: sound, fills the box exactly, knows no label that the image lacks.
template <int Dim>
void expect_fills_box(const LabelImage<Dim>& image, MeshOptions options) {
  options.keep_background = true;
  const Mesh<Dim> mesh = meshed(image, options);
  const MeshDefects defects = validate(mesh, Execution(1));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  double box = 1;
  for (const double side : image.size()) box *= side;
  EXPECT_NEAR(defects.volume, box, 1e-9 * box);
  EXPECT_EQ(mesh.labels, image.labels);
}

/// Every option of both methods that changes the shape of the mesh.
std::vector<MeshOptions> variations() {
  std::vector<MeshOptions> all;
  for (const int balance : {1, 2, kUnbalanced}) {
    for (const char* pattern : {"2", "3", "auto"}) {
      MeshOptions options;
      options.method = Method::paper;
      options.balance = balance;
      options.pattern = pattern;
      options.smooth = balance;
      all.push_back(options);
    }
  }
  for (const FieldKind field : {FieldKind::solid_angle, FieldKind::linear, FieldKind::bspline3, FieldKind::dgf}) {
    all.push_back({.method = Method::guaranteed, .field = field});
    for (const double snap : {0.0, 0.4}) all.push_back({.method = Method::paper, .field = field, .snap = snap});
  }
  return all;
}

TEST(MeshImage, NoiseFillsTheBox) {
  unsigned seed = 0;
  Frame<2> flat;
  flat.spacing = {0.5, 2};
  Frame<3> solid;
  solid.spacing = {0.7, 0.7, 2.5};
  for (const MeshOptions& options : variations()) {
    const int labels = 2 + static_cast<int>(++seed % 7);
    expect_fills_box(testing::noise_image<2>({23, 17}, labels, seed), options);
    expect_fills_box(testing::noise_image<2>({16, 16}, labels, seed, flat), options);
    expect_fills_box(testing::noise_image<3>({9, 7, 8}, labels, seed), options);
    expect_fills_box(testing::noise_image<3>({8, 9, 4}, labels, seed, solid), options);
  }
}

TEST(MeshImage, BallsKeepTheirVolume) {
  for (const MeshOptions& options : variations()) {
    const auto image = testing::ball_image<3>({26, 25, 24}, 0.4, 5);
    const Fidelity f = measure_fidelity(image, meshed(image, options), 0, Execution(2));
    for (const LabelFidelity& l : f.labels) {
      if (l.label == 0) continue;
      EXPECT_EQ(l.label, 5);
      EXPECT_NEAR(l.volume / l.image_volume, 1, 0.05);
      EXPECT_GT(l.dice, 0.93);
      EXPECT_EQ(l.components, 1);
    }
  }
}

/// Only improvement looks at cells of the background.
TEST(MeshImage, WithoutBackgroundTheRestIsTheSame) {
  const auto image = testing::ball_image<3>({14, 13, 12}, 0.3, 5);
  for (const Method method : {Method::paper, Method::guaranteed}) {
    MeshOptions options{.method = method, .quality = 0};
    const Mesh<3> without = meshed(image, options);
    options.keep_background = true;
    const Mesh<3> with = meshed(image, options);
    const auto of_five = [&](const Mesh<3>& mesh) { return measure_labels(mesh, Execution(1)).labels.back(); };
    EXPECT_EQ(of_five(without).cells, of_five(with).cells);
    EXPECT_NEAR(of_five(without).volume / of_five(with).volume, 1, 1e-12);  // summed in another order
    EXPECT_EQ(without.cell_count(), of_five(with).cells);
    EXPECT_TRUE(validate(without, Execution(1)).sound());
  }
}

template <int Dim>
void expect_same(const Mesh<Dim>& a, const Mesh<Dim>& b) {
  EXPECT_EQ(a.points, b.points);
  ASSERT_EQ(a.blocks.size(), b.blocks.size());
  for (std::size_t i = 0; i < a.blocks.size(); ++i) {
    EXPECT_EQ(a.blocks[i].vertices, b.blocks[i].vertices);
    EXPECT_EQ(a.blocks[i].materials, b.blocks[i].materials);
  }
}

TEST(MeshImage, ThreadsDoNotMatter) {
  const auto image = testing::noise_image<3>({14, 13, 12}, 5, 3);
  for (const Method method : {Method::paper, Method::guaranteed}) {
    const Mesh<3> one = meshed(image, {.method = method}, 1);
    expect_same(one, meshed(image, {.method = method}, 2));
    expect_same(one, meshed(image, {.method = method}, 7));
  }
}

TEST(MeshImage, LabelValuesDoNotMatter) {
  for (const Method method : {Method::paper, Method::guaranteed}) {
    auto image = testing::noise_image<3>({12, 11, 10}, 4, 3);
    const MeshOptions options{.method = method, .keep_background = true};
    const Mesh<3> before = meshed(image, options);
    std::ranges::reverse(image.labels);
    expect_same(before, meshed(image, options));
  }
}

/// The bound that gives the default method its name, on the worst images that there are.
TEST(MeshImage, AnglesOfTheDefaultAreBounded) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const auto image = testing::noise_image<3>({16, 8, 24}, 2 << (seed % 4), seed);
    MeshOptions options;
    options.sizes.min_size = 1;
    options.keep_background = seed % 2 == 0;
    const MeshQuality quality = measure_quality(meshed(image, options), image.frame, 0, Execution(2));
    EXPECT_GE(quality.angles.min, 18 - 1e-6);
    EXPECT_LE(quality.angles.max, 157.5 + 1e-6);
  }
}

/// Cells that are much larger than voxels reach the target of the improvement as well.
TEST(MeshImage, LargeCellsReachTheTarget) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    constexpr std::int32_t kSide = 800;
    std::mt19937 random(seed);
    std::array<Vec<2>, 10> seeds;
    for (auto& s : seeds) s = {0.001 * kSide * (random() % 1000), 0.001 * kSide * (random() % 1000)};
    std::vector<std::int32_t> labels;
    for (std::int32_t y = 0; y < kSide; ++y)
      for (std::int32_t x = 0; x < kSide; ++x) {
        const auto distance = [&](const Vec<2>& s) { return squared_norm(Vec<2>{x + 0.5, y + 0.5} - s); };
        labels.push_back(1 + static_cast<std::int32_t>(std::ranges::min_element(seeds, {}, distance) - seeds.begin()));
      }
    MeshOptions options;
    options.sizes.min_size = seed % 2 ? 20 : 40;
    const auto image = make_label_image<2>({kSide, kSide}, labels);
    EXPECT_GE(measure_quality(meshed(image, options), image.frame, 0, Execution(2)).angles.min, 20) << seed;
  }
}

std::int64_t cells_of(const auto& mesh, CellType type) {
  const auto block = std::ranges::find(mesh.blocks, type, &CellBlock::type);
  return block == mesh.blocks.end() ? 0 : block->size();
}

/// Two balls in a box: sound, true to the image, and with far fewer cells than simplices alone.
template <int Dim>
void expect_good_hybrid(const LabelImage<Dim>& image, MeshOptions options) {
  options.elements = Elements::hybrid;
  expect_fills_box(image, options);
  options.keep_background = true;
  const Mesh<Dim> hybrid = meshed(image, options);
  expect_same(hybrid, meshed(image, options, 1));
  EXPECT_GT(cells_of(hybrid, Dim == 2 ? CellType::quad : CellType::hexahedron), 0);
  EXPECT_GT(cells_of(hybrid, kSimplex<Dim>), 0);
  options.elements = Elements::simplices;
  const Mesh<Dim> plain = meshed(image, options);
  EXPECT_LT(hybrid.cell_count(), plain.cell_count());
  const Fidelity a = measure_fidelity(image, hybrid, 0, Execution(2)),
                 b = measure_fidelity(image, plain, 0, Execution(2));
  for (std::size_t i = 0; i < a.labels.size(); ++i) {
    EXPECT_NEAR(a.labels[i].volume / b.labels[i].volume, 1, 0.01);
    EXPECT_NEAR(a.labels[i].dice, b.labels[i].dice, 0.01);
    EXPECT_EQ(a.labels[i].components, b.labels[i].components);
  }
  options.elements = Elements::hybrid;
  options.keep_background = false;
  EXPECT_TRUE(validate(meshed(image, options), Execution(1)).sound());
}

TEST(MeshImage, HybridMeshesAreSoundAndSmaller) {
  Frame<3> solid;
  solid.spacing = {0.7, 0.7, 1.4};
  for (const char* pattern : {"auto", "3"}) {
    MeshOptions options;
    options.method = Method::paper;
    options.pattern = pattern;
    options.balance = *pattern == '3' ? kUnbalanced : 1;
    expect_good_hybrid(testing::ball_image<2>({41, 38}, 0.3, 5), options);
    expect_good_hybrid(testing::ball_image<3>({22, 21, 20}, 0.3, 5), options);
    expect_good_hybrid(testing::ball_image<3>({22, 21, 10}, 0.3, 5, solid), options);
  }
  expect_good_hybrid(testing::ball_image<2>({41, 38}, 0.3, 5), {});
  expect_good_hybrid(testing::ball_image<3>({26, 25, 24}, 0.3, 5), {});
}

/// The default method improves first and merges simplices then: interfaces are the same, facet for facet.
TEST(MeshImage, HybridMeshesHaveTheInterfacesOfSimplicesAndHalfTheCells) {
  for (const bool keep_background : {true, false}) {
    const auto image = testing::ball_image<3>({40, 40, 40}, 0.31, 2);
    MeshOptions options;
    options.keep_background = keep_background;
    options.sizes.min_size = 1;
    const Mesh<3> plain = meshed(image, options);
    options.elements = Elements::hybrid;
    const Mesh<3> hybrid = meshed(image, options);
    const Hull hull = keep_background ? Hull::leave_out : Hull::include;
    EXPECT_EQ(testing::interfaces_of(hybrid, hull), testing::interfaces_of(plain, hull));
    EXPECT_LE(2 * hybrid.cell_count(), plain.cell_count());
    EXPECT_TRUE(validate(hybrid, Execution(2)).sound());
    const MeshQuality quality = measure_quality(hybrid, image.frame, 0, Execution(2));
    EXPECT_GE(quality.angles.min, 20 - 1e-6);
    EXPECT_LE(quality.angles.max, 155 + 1e-6);
  }
}

TEST(MeshImage, StopsWhenItIsAskedTo) {
  Execution execution(2);
  execution.cancel();
  EXPECT_THROW(mesh_image(testing::noise_image<3>({20, 18, 16}, 5, 3), {}, execution), Cancelled);
}

TEST(MeshImage, RefusesOptionsThatContradict) {
  const auto image = testing::ball_image<2>({20, 20}, 0.3);
  const auto refuses = [&](const std::function<void(MeshOptions&)>& change) {
    MeshOptions options;
    change(options);
    EXPECT_THROW(meshed(image, options), Error);
  };
  refuses([](MeshOptions& o) { o.sizes.min_size = 3, o.sizes.max_size = 2; });
  refuses([](MeshOptions& o) { o.sizes.min_size = -1; });
  refuses([](MeshOptions& o) { o.pattern = "1"; });
  refuses([](MeshOptions& o) { o.field = FieldKind::grey; });
  refuses([](MeshOptions& o) { o.method = Method::paper, o.snap = 0.7; });
  refuses([](MeshOptions& o) { o.method = Method::paper, o.field = FieldKind::grey; });
  refuses([](MeshOptions& o) { o.balance = 2; });
  refuses([](MeshOptions& o) { o.order = MaterialOrder::label; });
  refuses([](MeshOptions& o) { o.first = {1}; });
  refuses([](MeshOptions& o) { o.method = Method::hege, o.elements = Elements::hybrid; });
  refuses([](MeshOptions& o) { o.shift = 0.3; });
  refuses([](MeshOptions& o) { o.elements = Elements::boxes, o.shift = 0.5; });
  refuses([](MeshOptions& o) { o.elements = Elements::boxes, o.snap = 0.2; });
  refuses([](MeshOptions& o) { o.elements = Elements::boxes, o.quality = 25; });
  refuses([](MeshOptions& o) { o.smooth = 2; });
  refuses([](MeshOptions& o) { o.sizes.material_size = {0, -1}; });
}

}  // namespace
}  // namespace treemarch
