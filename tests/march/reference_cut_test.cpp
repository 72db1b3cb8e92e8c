#include "treemarch/march/reference_cut.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "march/march_meshes.h"
#include "support/images.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::same_mesh;

constexpr ReferencePlaces kPlaces[] = {ReferencePlaces::middle, ReferencePlaces::equal_weights};

template <int Dim>
Mesh<Dim> cut(const Mesh<Dim>& mesh, const Field<Dim>& field, ReferencePlaces places, ReferenceReport& report,
              int threads = 2) {
  Execution execution(threads);
  return cut_by_reference(mesh, field, places, mesh.labels, report, execution);
}

template <int Dim>
Field<Dim> field_of(const LabelImage<Dim>& image, FieldKind kind) {
  Execution execution(1);
  return build_field(image, {.kind = kind}, execution);
}

/// What all references promise: positive, conforming, the same hull; every cell at an old vertex has its label.
template <int Dim>
void expect_labels_kept(const Mesh<Dim>& before, const Mesh<Dim>& after, const Field<Dim>& field, double volume) {
  const MeshDefects defects = validate(after, Execution(1));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_NEAR(defects.volume, volume, 1e-12 * volume);
  const CellBlock& block = after.blocks[0];
  const auto old = static_cast<VertexId>(before.points.size());
  for (std::int64_t i = 0; i < block.size(); ++i) {
    const MaterialId m = block.materials[static_cast<std::size_t>(i)];
    int corners = 0;
    for (int k = 0; k <= Dim; ++k) {
      const VertexId v = block.cell(i)[k];
      if (v >= old) continue;
      ++corners;
      std::array<LabelWeight, 1> best{};
      field.sample(after.points[v], best);
      EXPECT_EQ(field.weight(after.points[v], m), best[0].weight);
    }
    EXPECT_GT(corners, 0);
  }
}

template <int Dim>
void noise_is_cut(int side) {
  for (const int labels : {2, 3, 6}) {
    Coord<Dim> extent;
    extent.fill(side);
    const auto image = testing::noise_image<Dim>(extent, labels, 3);
    for (const FieldKind kind : {FieldKind::linear, FieldKind::gauss}) {
      const Field<Dim> field = field_of(image, kind);
      for (const ReferencePlaces places : kPlaces) {
        Mesh<Dim> mesh = testing::noise_mesh<Dim>(side, 1, 1);
        mesh.labels = image.labels;
        testing::jitter(mesh, 0.2, side, 4);
        ReferenceReport report;
        const Mesh<Dim> after = cut(mesh, field, places, report);
        expect_labels_kept(mesh, after, field, std::pow(side, Dim));
        EXPECT_EQ(report.triple_points > 0, labels > 2);
        EXPECT_EQ(report.inner_points > 0, labels > 3 && Dim == 3);
        ReferenceReport again;
        EXPECT_TRUE(same_mesh(after, cut(mesh, field, places, again, 1)));
      }
    }
  }
}
TEST(ReferenceCut, Noise2D) { noise_is_cut<2>(14); }
TEST(ReferenceCut, Noise3D) { noise_is_cut<3>(7); }

/// One simplex whose corners are centres of voxels with the labels given.
template <int Dim>
Mesh<Dim> one_simplex() {
  Mesh<Dim> mesh;
  mesh.points.resize(Dim + 1, Frame<Dim>::filled(0.5));
  CellBlock block;
  block.type = kSimplex<Dim>;
  block.materials = {0};
  for (int k = 0; k <= Dim; ++k) block.vertices.push_back(static_cast<VertexId>(k));
  for (int d = 0; d < Dim; ++d) mesh.points[static_cast<std::size_t>(d) + 1][d] = 3.5;
  mesh.blocks.push_back(block);
  return mesh;
}

template <int Dim>
LabelImage<Dim> corners_image(const std::array<std::int32_t, Dim + 1>& labels) {
  Coord<Dim> extent;
  extent.fill(4);
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)), labels[0]);
  for (int d = 0; d < Dim; ++d) {
    Coord<Dim> c{};
    c[d] = 3;
    values[static_cast<std::size_t>(linear_index(c, extent))] = labels[static_cast<std::size_t>(d) + 1];
  }
  return make_label_image(extent, values);
}

template <int Dim>
std::vector<double> shares(const std::array<std::int32_t, Dim + 1>& labels) {
  const auto image = corners_image<Dim>(labels);
  Mesh<Dim> mesh = one_simplex<Dim>();
  mesh.labels = image.labels;
  ReferenceReport report;
  mesh = cut(mesh, field_of(image, FieldKind::linear), ReferencePlaces::middle, report);
  std::vector<double> volume(image.labels.size(), 0.0);
  double all = 0;
  for (std::int64_t i = 0; i < mesh.blocks[0].size(); ++i) {
    const double v = cell_volume<Dim>(mesh.points.data(), kSimplex<Dim>, mesh.blocks[0].cell(i));
    EXPECT_GT(v, 0);
    volume[mesh.blocks[0].materials[static_cast<std::size_t>(i)]] += v;
    all += v;
  }
  for (double& v : volume) v = std::round(v / all * 1e9) / 1e9;
  return volume;
}

// Edges at their middles, triangles and tetrahedra at their centroids: shares of the volume are fractions that one can
// compute by hand.
TEST(ReferenceCut, MiddlesDivideAsInNielsonAndFranke) {
  using Shares = std::vector<double>;
  EXPECT_EQ(shares<2>({1, 1, 1}), (Shares{1}));
  EXPECT_EQ(shares<2>({1, 1, 2}), (Shares{0.75, 0.25}));
  EXPECT_EQ(shares<2>({1, 2, 3}), (Shares{0.333333333, 0.333333333, 0.333333333}));
  EXPECT_EQ(shares<3>({1, 1, 1, 2}), (Shares{0.875, 0.125}));
  EXPECT_EQ(shares<3>({1, 1, 2, 2}), (Shares{0.5, 0.5}));
  EXPECT_EQ(shares<3>({1, 2, 2, 1}), (Shares{0.5, 0.5}));
  EXPECT_EQ(shares<3>({1, 2, 3, 4}), (Shares{0.25, 0.25, 0.25, 0.25}));
  const Shares three = shares<3>({1, 1, 2, 3});
  EXPECT_DOUBLE_EQ(three[1], three[2]);
  EXPECT_NEAR(three[0] + three[1] + three[2], 1, 1e-8);
}

// Weights are linear within the triangle: they are equal in pairs on its sides and all three at the triple point.
TEST(ReferenceCut, FractionsMeetWhereTheyAreEqual) {
  const auto image = corners_image<2>({1, 2, 3});
  const Field<2> field = field_of(image, FieldKind::gauss);
  Mesh<2> mesh = one_simplex<2>();
  mesh.labels = image.labels;
  ReferenceReport report;
  const Mesh<2> after = cut(mesh, field, ReferencePlaces::equal_weights, report);
  ASSERT_EQ(after.points.size(), 7U);
  const auto weights_at = [&](std::size_t p) {
    const Vec<2>& x = after.points[p];
    const std::array<double, 3> share{1 - (x[0] - 0.5) / 3 - (x[1] - 0.5) / 3, (x[0] - 0.5) / 3, (x[1] - 0.5) / 3};
    std::array<double, 3> weight{};
    for (MaterialId m = 0; m < 3; ++m)
      for (std::size_t k = 0; k < 3; ++k) weight[m] += share[k] * field.weight(mesh.points[k], m);
    return weight;
  };
  constexpr MaterialId kEnds[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  for (std::size_t e = 0; e < 3; ++e) {
    const auto w = weights_at(3 + e);
    EXPECT_NEAR(w[kEnds[e][0]], w[kEnds[e][1]], 1e-6);
  }
  const auto w = weights_at(6);
  EXPECT_NEAR(w[0], w[1], 1e-6);
  EXPECT_NEAR(w[0], w[2], 1e-6);
}

// New vertices are numbered by their edges; on each the weights of the labels at its ends are equal if they are linear
// in between, or the cut keeps its distance from an end.
TEST(ReferenceCut, CutsAreWhereWeightsAreEqual) {
  const auto image = testing::noise_image<3>({7, 7, 7}, 4, 3);
  const Field<3> field = field_of(image, FieldKind::gauss);
  Mesh<3> mesh = testing::noise_mesh<3>(7, 1, 1);
  mesh.labels = image.labels;
  testing::jitter(mesh, 0.2, 7, 4);
  ReferenceReport report;
  const Mesh<3> after = cut(mesh, field, ReferencePlaces::equal_weights, report);
  std::vector<MaterialId> label;
  for (const Vec<3>& x : mesh.points) {
    std::array<LabelWeight, 1> best{};
    field.sample(x, best);
    label.push_back(best[0].material);
  }
  std::set<std::pair<VertexId, VertexId>> edges;
  for (std::int64_t i = 0; i < mesh.blocks[0].size(); ++i)
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b) {
        const VertexId u = mesh.blocks[0].cell(i)[a], v = mesh.blocks[0].cell(i)[b];
        if (u < v && label[u] != label[v]) edges.emplace(u, v);
      }
  ASSERT_EQ(static_cast<std::int64_t>(edges.size()), report.cut_edges);
  std::size_t p = mesh.points.size();
  int at_an_end = 0;
  for (const auto& [u, v] : edges) {
    const Vec<3>&a = mesh.points[u], &b = mesh.points[v], &x = after.points[p++];
    const double t = dot(x - a, b - a) / squared_norm(b - a);
    EXPECT_NEAR(norm(a + t * (b - a) - x), 0, 1e-12);
    if (t < 0.0101 || t > 0.9899) {
      ++at_an_end;
      continue;
    }
    const double lead = (1 - t) * field.difference(a, label[u], label[v]) + t * field.difference(b, label[u], label[v]);
    EXPECT_NEAR(lead, 0, 1e-6);
  }
  EXPECT_LT(at_an_end, static_cast<int>(edges.size()) / 10);
}

}  // namespace
}  // namespace treemarch
