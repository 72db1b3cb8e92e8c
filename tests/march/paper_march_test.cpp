#include "treemarch/march/paper_march.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "march/march_meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::ball_mesh;
using testing::jitter;
using testing::noise_mesh;
using testing::same_mesh;

template <int Dim>
void expect_sound(const Mesh<Dim>& mesh, double volume) {
  Execution execution(1);
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_NEAR(defects.volume, volume, 1e-12 * volume);
  EXPECT_DOUBLE_EQ(defects.box_volume, volume);
}

template <int Dim>
std::vector<double> volumes(const Mesh<Dim>& mesh) {
  std::vector<double> sums(mesh.labels.size(), 0.0);
  for (const CellBlock& block : mesh.blocks) {
    for (std::int64_t i = 0; i < block.size(); ++i) {
      sums[block.materials[i]] += cell_volume<Dim>(mesh.points.data(), block.type, block.cell(i));
    }
  }
  return sums;
}

template <int Dim>
void noise_stays_sound(int side, const std::vector<int>& label_counts = {2, 4, 8}) {
  Execution execution(2);
  for (const int labels : label_counts) {
    for (const double snap : {0.0, 0.2, 0.45}) {
      for (const bool shaken : {false, true}) {
        Mesh<Dim> mesh = noise_mesh<Dim>(side, labels, 11 + labels);
        if (shaken) jitter(mesh, 0.15, side, 5);
        const auto before = mesh.cell_count();
        PaperMarchOptions<Dim> options;
        options.snap = snap;
        options.revisit = shaken;
        if (Dim == 4)
          options.field = [side](MaterialId material, std::span<const Vec<Dim>> x, std::span<double> values) {
            for (std::size_t i = 0; i < x.size(); ++i)
              values[i] = 0.5 + 0.4 * std::sin(3.1 * x[i][0] + x[i][1] + 2.3 * x[i][Dim - 1] + material + side);
          };
        const PaperMarchReport report = march_materials(mesh, options, execution);
        SCOPED_TRACE(::testing::Message() << labels << " labels, snap " << snap << ", shaken " << shaken);
        expect_sound(mesh, std::pow(side, Dim));
        EXPECT_GT(report.cuts, 0);
        // Solid angles of the plain lattice are eighths: with two labels no cut is near a vertex.
        EXPECT_EQ(report.snapped > 0, snap > 0.2 || (snap > 0 && (shaken || labels > 2 || Dim == 4)));
        EXPECT_GT(mesh.cell_count(), before);
        std::int64_t cells = 0;
        for (const auto n : report.cells_after) cells += n;
        EXPECT_EQ(cells, mesh.cell_count());
      }
    }
  }
}

TEST(PaperMarch, NoiseStaysSound2D) { noise_stays_sound<2>(12); }
TEST(PaperMarch, NoiseStaysSound3D) { noise_stays_sound<3>(7); }
TEST(PaperMarch, NoiseStaysSound4D) { noise_stays_sound<4>(3, {3}); }

TEST(PaperMarch, FourDimensionsNeedAField) {
  Execution execution(1);
  Mesh<4> mesh = noise_mesh<4>(2, 2, 1);
  EXPECT_THROW(march_materials(mesh, {}, execution), Error);
}

TEST(PaperMarch, AFlatInterfaceIsLeftAsItIs) {
  for (const double snap : {0.0, 0.2}) {
    Mesh<3> mesh = testing::box_mesh<3>({6, 5, 4}, [](const Coord<3>& c) { return c[0] < 3 ? 1 : 2; });
    const Mesh<3> before = mesh;
    Execution execution(1);
    PaperMarchOptions<3> options;
    options.snap = snap;
    const auto report = march_materials(mesh, options, execution);
    EXPECT_TRUE(same_mesh(mesh, before));
    EXPECT_EQ(report.cuts, 0);
    EXPECT_EQ(report.snapped, 0);
  }
}

// The field is 1 and 0 at the vertices of one material nearest to the staircase and linear between, so vertices and
// cuts of the interface lie on the plane. (Vertices on the hull see fewer cells and may be of one material sooner.)
TEST(PaperMarch, AStaircaseUnderALinearFieldBecomesAPlane) {
  for (const double shift : {0.0, 0.3}) {
    Mesh<3> mesh = testing::box_mesh<3>({8, 8, 8}, [](const Coord<3>& c) { return c[0] + c[1] + c[2] < 11 ? 1 : 2; });
    Execution execution(1);
    PaperMarchOptions<3> options;
    options.field = [&](MaterialId material, std::span<const Vec<3>> points, std::span<double> values) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const double s = points[i][0] + points[i][1] + points[i][2];
        const double f =
            s < 12 + shift ? 0.5 + (12 + shift - s) / (4 + 2 * shift) : 0.5 - (s - 12 - shift) / (4 - 2 * shift);
        values[i] = material == 0 ? f : 1 - f;
      }
    };
    const auto report = march_materials(mesh, options, execution);
    expect_sound(mesh, 512);
    EXPECT_EQ(report.snapped > 0, shift > 0);
    std::vector<int> seen(mesh.points.size(), 0);
    const CellBlock& block = mesh.blocks[0];
    for (std::int64_t i = 0; i < block.size(); ++i) {
      for (int k = 0; k < 4; ++k) seen[block.cell(i)[k]] |= 1 << block.materials[i];
    }
    int between = 0;
    for (std::size_t v = 0; v < seen.size(); ++v) {
      const Vec<3>& x = mesh.points[v];
      if (seen[v] != 3 || *std::ranges::min_element(x) < 1.5 || *std::ranges::max_element(x) > 6.5) continue;
      ++between;
      // With a shift the slopes on the two sides differ, and an edge across both is not linear.
      EXPECT_NEAR(x[0] + x[1] + x[2], 12 + shift, shift == 0 ? 1e-12 : 0.25);
    }
    EXPECT_GT(between, 30);
  }
}

TEST(PaperMarch, ABallKeepsItsVolume) {
  const double radius = 9.3;
  const double exact = 4 * std::numbers::pi / 3 * std::pow(radius, 3);
  Execution execution(2);
  const auto missing = [&](int halves, bool revisit) {
    Mesh<3> mesh = ball_mesh<3>(24, radius, halves);
    PaperMarchOptions<3> options;
    options.revisit = revisit;
    const auto report = march_materials(mesh, options, execution);
    expect_sound(mesh, std::pow(24, 3));
    EXPECT_TRUE(report.lost.empty());
    const auto v = volumes(mesh);
    return exact - std::accumulate(v.begin() + 1, v.end(), 0.0);
  };
  EXPECT_LT(std::abs(missing(0, false)), 0.03 * exact);
  EXPECT_LT(std::abs(missing(1, false)), 0.04 * exact);
  // With two materials there is nothing to revisit; with three the ball shrinks in the turns of both halves as well.
  EXPECT_EQ(missing(0, false), missing(0, true));
  EXPECT_GT(missing(1, true), missing(1, false));
}

template <int Dim>
void same_for_any_threads(int side) {
  Mesh<Dim> first;
  for (const int threads : {1, 2, 7}) {
    Mesh<Dim> mesh = noise_mesh<Dim>(side, 5, 3);
    Execution execution(threads);
    march_materials(mesh, {}, execution);
    if (threads == 1) first = mesh;
    EXPECT_TRUE(same_mesh(mesh, first)) << threads << " threads";
  }
}

TEST(PaperMarch, SameForAnyThreads2D) { same_for_any_threads<2>(20); }
TEST(PaperMarch, SameForAnyThreads3D) { same_for_any_threads<3>(9); }

// Materials are numbered by first appearance and separated in that order: values of labels change nothing.
TEST(PaperMarch, LabelValuesChangeNothing) {
  Mesh<3> a = noise_mesh<3>(6, 4, 9);
  Mesh<3> b = a;
  for (auto& label : b.labels) label = 70000 - label;
  const auto labels = b.labels;
  Execution execution(1);
  march_materials(a, {}, execution);
  march_materials(b, {}, execution);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.blocks[0].vertices, b.blocks[0].vertices);
  EXPECT_EQ(a.blocks[0].materials, b.blocks[0].materials);
  EXPECT_EQ(b.labels, labels);
}

// Renumbering the materials and separating them in the old order gives the same as before, renumbered. (The lattice is
// shaken, since ties between neighbours go to the smaller number.)
TEST(PaperMarch, OrderIsAnOption) {
  Mesh<3> a = ball_mesh<3>(10, 3.7, 1);
  jitter(a, 0.1, 10, 4);
  Mesh<3> b = a;
  const std::vector<MaterialId> renumber = {2, 0, 1};
  for (auto& m : b.blocks[0].materials) m = renumber[m];
  Execution execution(1);
  march_materials(a, {}, execution);
  PaperMarchOptions<3> options;
  options.order = {2, 0, 1};
  march_materials(b, options, execution);
  for (auto& m : a.blocks[0].materials) m = renumber[m];
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.blocks[0].vertices, b.blocks[0].vertices);
  EXPECT_EQ(a.blocks[0].materials, b.blocks[0].materials);
}

TEST(PaperMarch, LostMaterialsAreReported) {
  // A single cell of the grid has solid angles of at most 1/8 at its corners in the Kuhn mesh's average: it vanishes.
  Mesh<3> mesh = testing::box_mesh<3>({5, 5, 5}, [](const Coord<3>& c) { return c == Coord<3>{2, 2, 2} ? 7 : 1; });
  Execution execution(1);
  const auto report = march_materials(mesh, {}, execution);
  EXPECT_EQ(report.lost, std::vector<MaterialId>{1});
  EXPECT_EQ(report.cells_before[1], 6);
  EXPECT_EQ(report.cells_after[1], 0);
  expect_sound(mesh, 125);
}

TEST(PaperMarch, OnlySimplicesMayBeCut) {
  Mesh<3> mesh = testing::mixed_mesh();
  Execution execution(1);
  EXPECT_THROW(march_materials(mesh, {}, execution), Error);
  for (CellBlock& block : mesh.blocks) std::ranges::fill(block.materials, MaterialId{0});
  const Mesh<3> before = mesh;
  march_materials(mesh, {}, execution);
  EXPECT_TRUE(same_mesh(mesh, before));
}

TEST(PaperMarch, OptionsOutOfRangeAreErrors) {
  Mesh<2> mesh = noise_mesh<2>(3, 2, 1);
  Execution execution(1);
  EXPECT_THROW(march_materials(mesh, {.snap = 0.5}, execution), Error);
  EXPECT_THROW(march_materials(mesh, {.tolerance = -1}, execution), Error);
  EXPECT_THROW(march_materials(mesh, {.order = {0, 0}}, execution), Error);
  EXPECT_THROW(march_materials(mesh, {.order = {2}}, execution), Error);
}

}  // namespace
}  // namespace treemarch
