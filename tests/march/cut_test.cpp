#include "treemarch/march/cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <set>

#include "support/images.h"
#include "treemarch/march/quality_floor.h"
#include "treemarch/mesh/simplex_quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"

namespace treemarch {
namespace {

using testing::ball_image;
using testing::noise_image;

template <int Dim>
struct Cut {
  Mesh<Dim> mesh;
  SizedLattice<Dim> sized;
  CutReport report;
};

/// Meshes an image by the stages up to the cut. Cells of `smallest` at interfaces; everywhere, if `uniform`.
template <int Dim>
Cut<Dim> cut_image(const LabelImage<Dim>& image, double smallest, bool uniform, int threads = 2,
                   FieldKind kind = FieldKind::dgf, double floor = 18) {
  Execution execution(threads);
  Cut<Dim> cut;
  cut.sized = choose_cubic_lattice(image, smallest, uniform ? 2 * smallest : 8 * smallest);
  SizingRule rule;
  rule.min_size = 1.3 * smallest;
  rule.max_size = uniform ? rule.min_size : 8 * smallest;
  const auto levels = required_levels(image, cut.sized, rule, execution);
  const auto tree = build_spacetree<Dim>(cut.sized.lattice, cut.sized.pattern, levels, 1, execution);
  FieldOptions field;
  field.kind = kind;
  CutOptions options;
  options.quality_floor = floor;
  cut.mesh = cut_lattice(tessellate_body_centred<Dim>(tree, execution), build_field(image, field, execution),
                         image.labels, options, cut.report, execution);
  return cut;
}

template <int Dim>
double worst_quality(const Mesh<Dim>& mesh) {
  AngleRange worst;
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t i = 0; i < block.size(); ++i) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.points[block.cell(i)[k]];
    worst.merge(angle_range<Dim>(p));
  }
  return quality(worst);
}

/// Vertices of far cells, and those that are said to, have cells of one material only.
template <int Dim>
void expect_one_material_inside(const Cut<Dim>& cut) {
  const CellBlock& block = cut.mesh.blocks[0];
  std::vector<MaterialId> of_vertex(cut.mesh.points.size(), kOutside);
  std::vector<std::uint8_t> several(cut.mesh.points.size(), 0);
  for (std::int64_t c = 0; c < block.size(); ++c)
    for (int k = 0; k <= Dim; ++k) {
      MaterialId& met = of_vertex[block.cell(c)[k]];
      several[block.cell(c)[k]] |= met != kOutside && met != block.materials[c];
      met = block.materials[c];
    }
  std::int64_t wrong = 0;
  for (std::int64_t c = 0; c < cut.report.far_cells; ++c)
    for (int k = 0; k <= Dim; ++k) wrong += several[block.cell(c)[k]];
  ASSERT_EQ(cut.report.at_interfaces.size(), several.size());
  for (std::size_t v = 0; v < several.size(); ++v) wrong += several[v] > cut.report.at_interfaces[v];
  EXPECT_EQ(wrong, 0);
}

template <int Dim>
void expect_sound(const Cut<Dim>& cut, const LabelImage<Dim>& image, double floor = 18) {
  const MeshDefects defects = validate(cut.mesh, Execution(2));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_GE(worst_quality(cut.mesh), floor - 1e-9);
  expect_one_material_inside(cut);
  const Vec<Dim> box = image.size();
  for (int d = 0; d < Dim; ++d) {
    double low = box[d], high = 0;
    for (const auto& p : cut.mesh.points) low = std::min(low, p[d]), high = std::max(high, p[d]);
    EXPECT_EQ(low, 0);
    EXPECT_NEAR(high, box[d], 1e-12 * box[d]);
  }
}

/// Labels in slabs and blobs of several sizes, with sharp junctions.
template <int Dim>
LabelImage<Dim> blob_image(const Coord<Dim>& extent, int labels, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Vec<Dim>> centres(static_cast<std::size_t>(3 * labels));
  for (auto& c : centres)
    for (int d = 0; d < Dim; ++d) c[d] = unit(random) * extent[d];
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<Dim> c = coord_of(i, extent);
    Vec<Dim> x{};
    for (int d = 0; d < Dim; ++d) x[d] = c[d] + 0.5;
    const auto nearest = std::min_element(centres.begin(), centres.end(), [&](const auto& a, const auto& b) {
      return squared_norm(a - x) < squared_norm(b - x);
    });
    values[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(nearest - centres.begin()) % labels * 3 - 4;
  }
  return make_label_image(extent, values);
}

TEST(cut, noise_keeps_the_floor_on_uniform_and_on_graded_trees) {
  for (const int labels : {2, 4, 8, 32})
    for (const bool uniform : {true, false}) {
      const auto image = noise_image<3>({16, 13, 11}, labels, 5U + static_cast<unsigned>(labels));
      SCOPED_TRACE(labels);
      expect_sound(cut_image(image, 1, uniform), image);
      expect_sound(cut_image(image, 2.5, uniform), image);
      const auto plane = noise_image<2>({40, 33}, labels, 7);
      expect_sound(cut_image(plane, 1, uniform), plane);
    }
}

TEST(cut, blobs_keep_the_floor_for_every_field) {
  for (const FieldKind kind :
       {FieldKind::linear, FieldKind::bspline3, FieldKind::gauss, FieldKind::dgf, FieldKind::solid_angle}) {
    const auto image = blob_image<3>({32, 24, 21}, 6, 3);
    const auto cut = cut_image(image, 1, false, 2, kind);
    expect_sound(cut, image);
    EXPECT_GT(cut.report.triple_points, 0);
    const auto plane = blob_image<2>({64, 50}, 6, 3);
    expect_sound(cut_image(plane, 1, false, 2, kind), plane);
  }
}

TEST(cut, uniform_lattice_keeps_25_degrees) {
  const auto image = blob_image<3>({20, 20, 20}, 5, 9);
  // Away from the hull, whose simplices are those of a graded tree, 25 is below the bound of 30.
  EXPECT_GT(worst_stencil<3>(lattice_shapes<3>(false), false, {1, 1, 1}).quality, 25);
  expect_sound(cut_image(image, 1, true, 2, FieldKind::dgf, 18.4), image, 18.4);
}

TEST(cut, anisotropic_voxels_reach_the_bound_of_their_lattice) {
  Frame<3> frame;
  frame.spacing = {0.4, 0.4, 2};
  const auto image = ball_image<3>({48, 48, 10}, 0.35, 1, frame);
  const auto cut = cut_image(image, 0.4, false);
  EXPECT_LE(stretch(cut.sized.lattice), kMostStretch);
  expect_sound(cut, image);
}

TEST(cut, same_bits_for_any_number_of_threads) {
  const auto image = blob_image<3>({24, 24, 24}, 8, 1);
  const auto one = cut_image(image, 1, false, 1);
  for (const int threads : {1, 2, 7}) {
    const auto other = cut_image(image, 1, false, threads);
    EXPECT_EQ(one.mesh.points, other.mesh.points);
    EXPECT_EQ(one.mesh.blocks[0].vertices, other.mesh.blocks[0].vertices);
    EXPECT_EQ(one.mesh.blocks[0].materials, other.mesh.blocks[0].materials);
  }
}

TEST(cut, permuted_label_values_change_nothing_else) {
  const auto image = blob_image<3>({24, 24, 24}, 8, 2);
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) values.push_back(1000 - 3 * image.labels[image.voxels[i]]);
  const auto permuted = make_label_image(image.extent, values, image.frame);
  const auto a = cut_image(image, 1, false), b = cut_image(permuted, 1, false);
  EXPECT_EQ(a.mesh.points, b.mesh.points);
  EXPECT_EQ(a.mesh.blocks[0].vertices, b.mesh.blocks[0].vertices);
  EXPECT_EQ(a.mesh.blocks[0].materials, b.mesh.blocks[0].materials);
  EXPECT_NE(a.mesh.labels, b.mesh.labels);
}

TEST(cut, permuted_internal_indices_change_next_to_nothing) {
  auto image = blob_image<3>({32, 32, 32}, 8, 2);
  const auto a = cut_image(image, 1, false);
  const auto n = static_cast<std::uint32_t>(image.labels.size());
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) image.voxels.set(i, n - 1 - image.voxels[i]);
  std::reverse(image.labels.begin(), image.labels.end());
  const auto b = cut_image(image, 1, false);
  const auto count = static_cast<double>(a.mesh.cell_count());
  EXPECT_NEAR(count, static_cast<double>(b.mesh.cell_count()), 1e-4 * count);
}

TEST(cut, mirrored_image_gives_as_many_cells) {
  const auto image = blob_image<3>({32, 32, 32}, 8, 4);
  const auto a = cut_image(image, 1, false);
  for (int axis = 0; axis < 3; ++axis) {
    auto mirrored = image;
    for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
      Coord<3> c = coord_of(i, image.extent);
      c[axis] = image.extent[axis] - 1 - c[axis];
      mirrored.voxels.set(i, image.voxels[linear_index(c, image.extent)]);
    }
    const auto b = cut_image(mirrored, 1, false);
    EXPECT_NEAR(static_cast<double>(a.mesh.cell_count()), static_cast<double>(b.mesh.cell_count()),
                0.005 * static_cast<double>(a.mesh.cell_count()));
  }
}

TEST(cut, one_material_is_the_lattice_itself) {
  const auto image = noise_image<3>({9, 8, 7}, 1, 0);
  const auto cut = cut_image(image, 1, true);
  expect_sound(cut, image);
  EXPECT_EQ(cut.mesh.cell_count(), cut.report.lattice_simplices);
}

/// A sheet or wire of one voxel keeps one component and most of its volume.
double kept_volume(const std::function<bool(int, int, int)>& inside) {
  const Coord<3> extent{24, 24, 24};
  std::vector<std::int32_t> values;
  std::int64_t voxels = 0;
  for (int z = 0; z < 24; ++z)
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 24; ++x) voxels += values.emplace_back(inside(x, y, z));
  const auto image = make_label_image(extent, values);
  const auto cut = cut_image(image, 1, false);
  expect_sound(cut, image);
  const CellBlock& block = cut.mesh.blocks[0];
  double volume = 0;
  std::vector<VertexId> parent(cut.mesh.points.size());  // vertices joined by cells of the thin material
  std::iota(parent.begin(), parent.end(), VertexId{0});
  const auto find = [&](VertexId v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (std::int64_t i = 0; i < block.size(); ++i) {
    if (cut.mesh.labels[block.materials[i]] != 1) continue;
    const auto p = [&](int k) { return cut.mesh.points[block.cell(i)[k]]; };
    volume += dot(cross(p(1) - p(0), p(2) - p(0)), p(3) - p(0)) / 6;
    for (int k = 1; k < 4; ++k) parent[find(block.cell(i)[k])] = find(block.cell(i)[0]);
  }
  std::set<VertexId> components;
  for (std::int64_t i = 0; i < block.size(); ++i)
    if (cut.mesh.labels[block.materials[i]] == 1) components.insert(find(block.cell(i)[0]));
  EXPECT_EQ(components.size(), 1U);
  return volume / static_cast<double>(voxels);
}

TEST(cut, sheets_of_one_voxel_survive) {
  EXPECT_GE(kept_volume([](int, int, int z) { return z == 11; }), 0.9);
  EXPECT_GE(kept_volume([](int x, int y, int z) { return x + y + z == 34; }), 0.9);
  EXPECT_GE(kept_volume([](int x, int, int z) { return z == 5 + x / 3; }), 0.9);
}

TEST(cut, wires_of_one_voxel_survive) {
  EXPECT_GE(kept_volume([](int x, int y, int z) { return x >= 4 && x < 20 && y == 11 && z == 12; }), 0.4);
  EXPECT_GE(kept_volume([](int x, int y, int z) { return x == 11 && z == 12 && y > 3; }), 0.4);
}

}  // namespace
}  // namespace treemarch
