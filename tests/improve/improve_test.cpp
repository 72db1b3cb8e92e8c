#include "treemarch/improve/improve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "improve/improve_meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::cut_image;
using testing::CutImage;
using testing::volumes;
using testing::worst_quality;

struct Case {
  int dim, labels;
  double speckles;
  unsigned seed;
  double target;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.dim << "D, " << c.labels << " labels, speckles " << c.speckles << ", seed " << c.seed << ", target "
       << c.target;
}

class ImproveBank : public ::testing::TestWithParam<Case> {};

template <int Dim>
LabelImage<Dim> image_of(const Case& c) {
  if constexpr (Dim == 2)
    return testing::mixed_image<2>({37, 30}, c.labels, c.speckles, c.seed);
  else
    return testing::mixed_image<3>({15, 14, 13}, c.labels, c.speckles, c.seed);
}

template <int Dim>
std::pair<Mesh<Dim>, ImproveReport> improved(const CutImage<Dim>& cut, const ImproveOptions& options, int threads) {
  Execution execution(threads);
  Mesh<Dim> mesh = cut.mesh;
  const ImproveReport report = improve(mesh, cut.field, cut.box, options, execution);
  return {std::move(mesh), report};
}

template <int Dim>
void check(const Case& c) {
  const CutImage<Dim> cut = cut_image(image_of<Dim>(c));
  const double before = worst_quality(cut.mesh);
  const std::vector<double> volume_before = volumes(cut.mesh);
  ImproveOptions options;
  options.quality = c.target;

  const auto [mesh, report] = improved(cut, options, 2);

  // Nothing is broken.
  const MeshDefects defects = validate(mesh, Execution(2));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  Vec<Dim> upper{};
  for (const Vec<Dim>& p : mesh.points)
    for (int d = 0; d < Dim; ++d) {
      EXPECT_GE(p[d], 0);
      upper[d] = std::max(upper[d], p[d]);
    }
  EXPECT_EQ(upper, cut.box);
  // Nothing is worse, and the report tells the truth.
  const double after = worst_quality(mesh);
  EXPECT_GE(after, std::min(before, c.target));
  EXPECT_NEAR(report.worst_before, std::min(before, c.target), 1e-9);
  EXPECT_NEAR(report.worst_after, std::min(after, c.target), 1e-9);
  EXPECT_EQ(report.below_after == 0, after >= c.target);
  EXPECT_EQ(report.stopped == ImproveStop::target_met, after >= c.target);
  // The goal of the default target is none below.
  if (c.target <= 20) {
    EXPECT_GE(after, c.target);
  }
  // Materials keep their place: each within a few percent of a voxel layer.
  const std::vector<double> volume_after = volumes(mesh);
  for (std::size_t m = 0; m < volume_after.size(); ++m) {
    if (volume_before[m] == 0) continue;
    EXPECT_GT(volume_after[m], 0);
    EXPECT_NEAR(volume_after[m], volume_before[m], 0.05 * volume_before[m] + 0.5) << "material " << m;
  }
  // Threads change no bit.
  for (const int threads : {1, 7}) {
    const Mesh<Dim> again = improved(cut, options, threads).first;
    EXPECT_EQ(again.points, mesh.points);
    EXPECT_EQ(again.blocks[0].vertices, mesh.blocks[0].vertices);
    EXPECT_EQ(again.blocks[0].materials, mesh.blocks[0].materials);
  }
}

TEST_P(ImproveBank, KeepsAllInvariantsAndReachesTheTarget) {
  if (GetParam().dim == 2)
    check<2>(GetParam());
  else
    check<3>(GetParam());
}

INSTANTIATE_TEST_SUITE_P(Images, ImproveBank,
                         ::testing::Values(Case{2, 2, 0, 1, 20}, Case{2, 4, 0.1, 2, 20}, Case{2, 8, 1, 3, 20},
                                           Case{2, 8, 0.3, 4, 30}, Case{3, 2, 0, 5, 20}, Case{3, 2, 1, 6, 20},
                                           Case{3, 4, 0.1, 7, 20}, Case{3, 8, 0.02, 8, 20}, Case{3, 8, 1, 9, 20},
                                           Case{3, 4, 0.3, 10, 25}, Case{3, 2, 0.02, 11, 26}));

TEST(Improve, LeavesAGoodMeshAlone) {
  const CutImage<3> cut = cut_image(testing::ball_image<3>({12, 12, 12}, 0.35));
  ImproveOptions options;
  options.quality = 15;
  Execution execution(2);
  Mesh<3> mesh = cut.mesh;
  const ImproveReport report = improve(mesh, cut.field, cut.box, options, execution);
  EXPECT_EQ(report.stopped, ImproveStop::target_met);
  EXPECT_EQ(report.moves, 0);
  EXPECT_EQ(mesh.blocks[0].vertices, cut.mesh.blocks[0].vertices);
}

TEST(Improve, SaysWhyItStopped) {
  const CutImage<3> cut = cut_image(testing::noise_image<3>({4, 4, 4}, 6, 1));
  Execution execution(2);
  const auto stop_of = [&](const ImproveOptions& options) {
    Mesh<3> mesh = cut.mesh;
    return improve(mesh, cut.field, cut.box, options, execution).stopped;
  };
  ImproveOptions options;
  options.quality = 0;
  options.pull = false;
  EXPECT_EQ(stop_of(options), ImproveStop::off);
  options.quality = 19;
  EXPECT_EQ(stop_of(options), ImproveStop::target_met);
  options.quality = 40;
  options.passes = 1;
  EXPECT_EQ(stop_of(options), ImproveStop::pass_limit);
  options.seconds = 1e-9;
  EXPECT_EQ(stop_of(options), ImproveStop::time_limit);
  options.quality = 80;
  EXPECT_THROW(stop_of(options), Error);
}

TEST(Improve, WorksOnAMeshWithoutItsBackground) {
  CutImage<3> cut = cut_image(testing::ball_image<3>({16, 16, 16}, 0.3));
  CellBlock& block = cut.mesh.blocks[0];
  CellBlock kept;
  kept.type = block.type;
  for (std::int64_t c = 0; c < block.size(); ++c) {
    if (cut.mesh.labels[block.materials[c]] == 0) continue;
    kept.vertices.insert(kept.vertices.end(), block.cell(c), block.cell(c) + 4);
    kept.materials.push_back(block.materials[c]);
  }
  block = kept;
  const double before = volumes(cut.mesh)[1];
  ImproveOptions options;
  options.quality = 28;
  Execution execution(2);
  const ImproveReport report = improve(cut.mesh, cut.field, cut.box, options, execution);
  EXPECT_GT(report.moves, 0);
  EXPECT_GE(worst_quality(cut.mesh), 28);
  const MeshDefects defects = validate(cut.mesh, execution);
  EXPECT_EQ(defects.inverted_cells + defects.overused_facets + defects.folded_facets, 0) << defects.describe();
  EXPECT_NEAR(volumes(cut.mesh)[1], before, 0.01 * before);
}

}  // namespace
}  // namespace treemarch
