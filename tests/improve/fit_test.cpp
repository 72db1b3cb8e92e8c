#include "treemarch/improve/fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "improve/improve_meshes.h"
#include "treemarch/improve/improve.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::CutImage;
using testing::volumes;
using testing::worst_quality;

/// Uniform cells of `side` voxels, improved to 20 degrees. \pre side divides the extent
template <int Dim>
CutImage<Dim> coarse_mesh(const LabelImage<Dim>& image, int side) {
  Execution execution(2);
  Lattice<Dim> lattice;
  RefinementPattern<Dim> pattern;
  Coord<Dim> two{};
  two.fill(2);
  pattern.factors.assign(1, two);
  for (int d = 0; d < Dim; ++d) {
    lattice.extent[d] = image.extent[d] / side;
    lattice.unit[d] = side * image.frame.spacing[d];
  }
  const std::vector<std::uint8_t> level(static_cast<std::size_t>(product(lattice.extent)), 1);
  const auto tree = build_spacetree<Dim>(lattice, pattern, level, 1, execution);
  CutImage<Dim> cut{build_field<Dim>(image, {}, execution), {}, image.size()};
  CutReport report;
  cut.mesh =
      cut_lattice<Dim>(tessellate_body_centred<Dim>(tree, execution), cut.field, image.labels, {}, report, execution);
  improve(cut.mesh, cut.field, cut.box, {}, execution);
  return cut;
}

template <int Dim>
Mesh<Dim> fitted(const CutImage<Dim>& cut, int threads = 2) {
  Execution execution(threads);
  Mesh<Dim> mesh = cut.mesh;
  const FitReport report = fit_interfaces(mesh, cut.field, cut.box, {}, execution);
  EXPECT_GT(report.moves, 0);
  EXPECT_LT(report.rms_after, report.rms_before);
  return mesh;
}

/// RMS distance of points all over the facets from a ball in the middle of the box.
template <int Dim>
double rms_from_ball(const Mesh<Dim>& mesh, const Vec<Dim>& box, double radius) {
  double sum = 0;
  std::int64_t n = 0;
  for (const FacetBlock& block : extract_interfaces(mesh, Hull::leave_out, Execution(2)))
    for (std::int64_t f = 0; f < block.size(); ++f)
      for (int corner = 0; corner <= Dim; ++corner) {  // the middle, and half way to each corner
        Vec<Dim> x = -0.5 * box;
        for (int k = 0; k < Dim; ++k) {
          const double share = corner == Dim ? 1.0 / Dim : 0.5 / Dim + (k == corner ? 0.5 : 0);
          x = x + share * mesh.points[block.vertices[f * Dim + k]];
        }
        sum += std::pow(norm(x) - radius, 2);
        ++n;
      }
  return std::sqrt(sum / static_cast<double>(n));
}

template <int Dim>
void check_ball(int side, double most) {
  Coord<Dim> extent{};
  extent.fill(36);
  const double radius = 0.36 * 36;
  const CutImage<Dim> cut = coarse_mesh(testing::ball_image<Dim>(extent, 0.36), side);
  const Mesh<Dim> mesh = fitted(cut);
  const double exact = Dim == 2 ? std::numbers::pi * radius * radius : 4 * std::numbers::pi / 3 * std::pow(radius, 3);
  EXPECT_LT(rms_from_ball(mesh, cut.box, radius), most * rms_from_ball(cut.mesh, cut.box, radius));
  EXPECT_LT(std::abs(volumes(mesh)[1] - exact), 0.4 * std::abs(volumes(cut.mesh)[1] - exact));
}

TEST(FitInterfaces, CoarseFacetsOfABallLieOnBothSidesOfIt) {
  check_ball<2>(6, 0.7);
  check_ball<3>(4, 0.9);
  check_ball<3>(6, 0.7);
}

template <int Dim>
void check_sound(const LabelImage<Dim>& image, int side) {
  const CutImage<Dim> cut = coarse_mesh(image, side);
  const Mesh<Dim> mesh = fitted(cut);
  EXPECT_TRUE(validate(mesh, Execution(2)).fills_box()) << validate(mesh, Execution(2)).describe();
  EXPECT_GE(worst_quality(mesh), std::min(20.0, worst_quality(cut.mesh)));
  EXPECT_EQ(mesh.blocks[0].vertices, cut.mesh.blocks[0].vertices);
  EXPECT_EQ(mesh.blocks[0].materials, cut.mesh.blocks[0].materials);
  for (std::size_t v = 0; v < mesh.points.size(); ++v)
    for (int d = 0; d < Dim; ++d) {
      if (cut.mesh.points[v][d] == 0 || cut.mesh.points[v][d] == cut.box[d]) {
        ASSERT_EQ(mesh.points[v][d], cut.mesh.points[v][d]);
      }
    }
  for (const int threads : {1, 7}) EXPECT_EQ(fitted(cut, threads).points, mesh.points);
}

TEST(FitInterfaces, AnyMeshStaysSound) {
  check_sound(testing::mixed_image<2>({48, 40}, 5, 0.02, 3), 4);
  check_sound(testing::mixed_image<3>({24, 20, 28}, 3, 0.02, 4), 2);
  check_sound(testing::mixed_image<3>({24, 20, 28}, 8, 0, 5), 4);
  check_sound(testing::noise_image<3>({12, 12, 12}, 3, 6), 3);
}

TEST(FitInterfaces, FollowsTheSideOfAMaterialThatWasLeftOut) {
  const LabelImage<3> image = testing::ball_image<3>({36, 36, 36}, 0.36);
  CutImage<3> cut = coarse_mesh(image, 6);
  const Mesh<3> whole = fitted(cut);
  // Without the background the same facets lie on the hull; the cells that limit moves are fewer.
  CellBlock inside;
  inside.type = CellType::tetrahedron;
  for (std::int64_t c = 0; c < cut.mesh.blocks[0].size(); ++c) {
    if (cut.mesh.blocks[0].materials[c] == 0) continue;
    inside.materials.push_back(1);
    inside.vertices.insert(inside.vertices.end(), cut.mesh.blocks[0].cell(c), cut.mesh.blocks[0].cell(c) + 4);
  }
  Mesh<3> alone = cut.mesh;
  alone.blocks[0] = inside;
  Execution execution(2);
  EXPECT_EQ(fit_interfaces(alone, cut.field, cut.box, {}, execution).facets, 0);
  EXPECT_GT(fit_interfaces(alone, cut.field, cut.box, {.quality = 20, .outside = 0}, execution).moves, 0);
  EXPECT_NEAR(volumes(alone)[1], volumes(whole)[1], 0.01 * volumes(whole)[1]);
}

TEST(FitInterfaces, LeavesSmallFacetsAndMeshesWithoutATargetAlone) {
  Execution execution(2);
  CutImage<3> fine = testing::cut_image(testing::ball_image<3>({12, 12, 12}, 0.35));
  const auto before = fine.mesh.points;
  EXPECT_EQ(fit_interfaces(fine.mesh, fine.field, fine.box, {.quality = 0}, execution).moves, 0);
  EXPECT_EQ(fine.mesh.points, before);
  for (Vec<3>& p : fine.mesh.points) p = 0.5 * p;  // facets of half the size, whatever they follow
  EXPECT_EQ(fit_interfaces(fine.mesh, fine.field, fine.box, {}, execution).facets, 0);
}

}  // namespace
}  // namespace treemarch
