#include "treemarch/smooth/smooth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "march/march_meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/march/paper_march.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::ball_mesh;
using testing::jitter;
using testing::noise_mesh;
using testing::same_mesh;

template <int Dim>
Mesh<Dim> marched(Mesh<Dim> mesh) {
  Execution execution(2);
  march_materials(mesh, {}, execution);
  return mesh;
}

SmoothOptions options_of(Smoother smoother, int steps, double displacement) {
  SmoothOptions options;
  options.smoother = smoother;
  options.steps = steps;
  options.max_displacement = displacement;
  return options;
}

/// Exactly what no step may touch: the cells, the hull's planes, the bound on the way, the worst angles.
template <int Dim>
void expect_kept(const Mesh<Dim>& before, const Mesh<Dim>& after, double side, double displacement) {
  Execution execution(1);
  EXPECT_EQ(before.blocks[0].vertices, after.blocks[0].vertices);
  EXPECT_EQ(before.blocks[0].materials, after.blocks[0].materials);
  const MeshDefects defects = validate(after, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_NEAR(defects.volume, std::pow(side, Dim), 1e-12 * std::pow(side, Dim));
  for (std::size_t v = 0; v < before.points.size(); ++v) {
    EXPECT_LE(norm(after.points[v] - before.points[v]), displacement * (1 + 1e-15));
    for (int d = 0; d < Dim; ++d) {
      for (const double face : {0.0, side}) EXPECT_EQ(before.points[v][d] == face, after.points[v][d] == face);
    }
  }
  const auto angles = [&](const Mesh<Dim>& mesh) { return measure_quality(mesh, Frame<Dim>{}, 0, execution).angles; };
  EXPECT_GE(angles(after).min, angles(before).min - 1e-9);
  EXPECT_LE(angles(after).max, angles(before).max + 1e-9);
}

template <int Dim>
void invariants(int side) {
  for (const int labels : {1, 2, 4}) {
    for (const Smoother smoother : {Smoother::laplacian, Smoother::taubin}) {
      Mesh<Dim> mesh = noise_mesh<Dim>(side, labels, 3);
      jitter(mesh, 0.2, side, 8);
      mesh = marched(std::move(mesh));
      const Mesh<Dim> before = mesh;
      Execution execution(2);
      const SmoothReport report = smooth(mesh, options_of(smoother, 6, 0.3), execution);
      SCOPED_TRACE(::testing::Message() << labels << " labels");
      expect_kept(before, mesh, side, 0.3);
      EXPECT_FALSE(same_mesh(before, mesh));
      EXPECT_EQ(report.interfaces.moves > 0, labels > 1);
      EXPECT_LE(std::max(report.interfaces.displacement, report.volume.displacement), 0.3);
    }
  }
}

TEST(Smooth, KeepsWhatItMust2D) { invariants<2>(14); }
TEST(Smooth, KeepsWhatItMust3D) { invariants<3>(7); }

/// Area-weighted root of the mean square angle between the ball's interface and the sphere, in degrees.
double normal_error(const Mesh<3>& mesh, const Vec<3>& centre) {
  Execution execution(1);
  double sum = 0;
  double area = 0;
  for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, execution)) {
    for (std::int64_t i = 0; i < block.size(); ++i) {
      if (block.first[i] != 0) continue;
      const VertexId* v = &block.vertices[3 * static_cast<std::size_t>(i)];
      const Vec<3> n = cross(mesh.points[v[1]] - mesh.points[v[0]], mesh.points[v[2]] - mesh.points[v[0]]);
      const Vec<3> r = 1.0 / 3 * (mesh.points[v[0]] + mesh.points[v[1]] + mesh.points[v[2]]) - centre;
      const double angle = std::acos(std::min(1.0, std::abs(dot(n, r)) / norm(n) / norm(r)));
      sum += norm(n) * angle * angle;
      area += norm(n);
    }
  }
  return std::sqrt(sum / area) * 180 / std::numbers::pi;
}

double ball_volume(const Mesh<3>& mesh) {
  double sum = 0;
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t i = 0; i < block.size(); ++i) {
    if (block.materials[i] != 0) sum += cell_volume<3>(mesh.points.data(), block.type, block.cell(i));
  }
  return sum;
}

TEST(Smooth, ABallGetsRounderAndKeepsItsVolume) {
  for (const int halves : {0, 1}) {
    const Mesh<3> before = marched(ball_mesh<3>(22, 8.3, halves));
    for (const Smoother smoother : {Smoother::laplacian, Smoother::taubin}) {
      Mesh<3> mesh = before;
      Execution execution(2);
      const SmoothReport report = smooth(mesh, options_of(smoother, 5, 0.5), execution);
      expect_kept(before, mesh, 22, 0.5);
      EXPECT_EQ(report.curves.moves > 0, halves > 0);
      const double factor = smoother == Smoother::laplacian ? 0.8 : 0.99;
      EXPECT_LT(normal_error(mesh, {11, 11, 11}), factor * normal_error(before, {11, 11, 11}));
      EXPECT_NEAR(ball_volume(mesh), ball_volume(before), 0.03 * ball_volume(before));
    }
  }
}

// Laplace's smoothing shrinks a ball, Taubin's does much less.
TEST(Smooth, TaubinShrinksLess) {
  const Mesh<3> before = marched(ball_mesh<3>(18, 6.3));
  double shrunk[2];
  for (const Smoother smoother : {Smoother::laplacian, Smoother::taubin}) {
    Mesh<3> mesh = before;
    Execution execution(1);
    smooth(mesh, options_of(smoother, 10, 1), execution);
    shrunk[smoother == Smoother::taubin] = std::abs(ball_volume(before) - ball_volume(mesh));
  }
  EXPECT_LT(3 * shrunk[1], shrunk[0]);
}

TEST(Smooth, AFlatInterfaceStaysFlatAndItsRimStaysOnTheHull) {
  Mesh<3> mesh = testing::box_mesh<3>({6, 6, 6}, [](const Coord<3>& c) { return c[0] < 3 ? 1 : 2; });
  const Mesh<3> flat = mesh;
  // Vertices of the interface move within their plane and, at its rim, within the hull.
  for (auto& x : mesh.points) {
    if (x[0] != 3) continue;
    for (int d = 1; d < 3; ++d) {
      if (x[d] > 0 && x[d] < 6) x[d] += 0.1 * std::sin(5 * x[1] + 3 * x[2]);
    }
  }
  const Mesh<3> before = mesh;
  Execution execution(1);
  smooth(mesh, options_of(Smoother::laplacian, 30, 10), execution);
  double distance_before = 0;
  double distance_after = 0;
  for (std::size_t v = 0; v < mesh.points.size(); ++v) {
    EXPECT_EQ(mesh.points[v][0] == 3, flat.points[v][0] == 3);
    distance_before += norm(before.points[v] - flat.points[v]);
    distance_after += norm(mesh.points[v] - flat.points[v]);
  }
  EXPECT_LT(distance_after, 0.5 * distance_before);
}

template <int Dim>
void same_for_any_threads(int side) {
  const Mesh<Dim> before = marched(noise_mesh<Dim>(side, 4, 6));
  Mesh<Dim> first;
  for (const int threads : {1, 2, 7}) {
    Mesh<Dim> mesh = before;
    Execution execution(threads);
    smooth(mesh, {}, execution);
    if (threads == 1) first = mesh;
    EXPECT_TRUE(same_mesh(mesh, first)) << threads << " threads";
  }
}

TEST(Smooth, SameForAnyThreads2D) { same_for_any_threads<2>(20); }
TEST(Smooth, SameForAnyThreads3D) { same_for_any_threads<3>(9); }

TEST(Smooth, OtherCellsThanSimplicesStayFixed) {
  Mesh<3> mesh = testing::mixed_mesh();
  mesh.points[12] = {0.6, 0.45, 1.4};
  const Mesh<3> before = mesh;
  Execution execution(1);
  smooth(mesh, {}, execution);
  EXPECT_TRUE(same_mesh(mesh, before));
}

TEST(Smooth, OptionsOutOfRangeAreErrors) {
  Mesh<2> mesh = noise_mesh<2>(3, 2, 1);
  Execution execution(1);
  const auto with = [](auto change) {
    SmoothOptions options;
    change(options);
    return options;
  };
  EXPECT_THROW(smooth(mesh, with([](auto& o) { o.steps = -1; }), execution), Error);
  EXPECT_THROW(smooth(mesh, with([](auto& o) { o.lambda = 0; }), execution), Error);
  EXPECT_THROW(smooth(mesh, with([](auto& o) { o.mu = -0.1; }), execution), Error);
  EXPECT_THROW(smooth(mesh, with([](auto& o) { o.max_displacement = -1; }), execution), Error);
  const Mesh<2> before = mesh;
  smooth(mesh, with([](auto& o) { o.steps = 0; }), execution);
  EXPECT_TRUE(same_mesh(mesh, before));
}

}  // namespace
}  // namespace treemarch
