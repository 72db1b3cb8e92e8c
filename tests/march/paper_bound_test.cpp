// The bound that the paper claims for d-linear separating functions of voxels, by enumeration: such a function takes
// finitely many values at the vertices of a tree of whole voxels, so a simplex is cut in finitely many ways.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "support/images.h"
#include "support/trees.h"
#include "treemarch/march/paper_march.h"
#include "treemarch/march/paper_split.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/simplex_quality.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

/// f - 1/2 at the corners of a simplex, in units of 1 / 2^Dim: a vertex sees 2^Dim voxels.
template <int Dim>
using Values = std::array<int, Dim + 1>;
template <int Dim>
constexpr int kHalf = 1 << (Dim - 1);

/// Angles of the pieces of a simplex whose corners are ordered as their vertices are; nothing if it is not cut.
template <int Dim>
AngleRange cut_angles(const std::array<Vec<Dim>, Dim + 1>& corners, const Values<Dim>& f) {
  AngleRange range;
  std::array<std::int8_t, Dim + 1> signs;
  for (int k = 0; k <= Dim; ++k) signs[k] = static_cast<std::int8_t>((f[k] > 0) - (f[k] < 0));
  if (std::ranges::count(signs, 1) == 0 || std::ranges::count(signs, -1) == 0) return range;
  constexpr auto kEnds = edge_ends<Dim>();
  std::array<Vec<Dim>, Dim + 1 + kEnds.size()> x;
  std::ranges::copy(corners, x.begin());
  for (std::size_t e = 0; e < kEnds.size(); ++e) {
    const auto [a, b] = kEnds[e];
    if (signs[a] * signs[b] < 0) x[Dim + 1 + e] = x[a] + (1.0 * f[a] / (f[a] - f[b])) * (x[b] - x[a]);
  }
  for (const auto& piece : simplex_split<Dim>(signs)) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = x[piece.corners[k]];
    AngleRange angles = angle_range<Dim>(p);
    if (angles.inverted()) {  // the corners are an odd permutation of a positive simplex
      std::swap(p[Dim - 1], p[Dim]);
      angles = angle_range<Dim>(p);
    }
    range.merge(angles);
  }
  return range;
}

/// What f can be at the corners of a simplex of a lattice of voxels, over all ways to fill the voxels around it.
template <int Dim>
std::set<Values<Dim>> possible_values(const std::array<Coord<Dim>, Dim + 1>& corners) {
  Coord<Dim> low = corners[0], high = corners[0];
  for (const auto& c : corners)
    for (int d = 0; d < Dim; ++d) low[d] = std::min(low[d], c[d]), high[d] = std::max(high[d], c[d]);
  Coord<Dim> extent;
  for (int d = 0; d < Dim; ++d) extent[d] = high[d] - low[d] + 2;
  std::map<unsigned, int> voxels;  // how many are seen by the same corners
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<Dim> v = coord_of(i, extent);
    unsigned seen_by = 0;
    for (int k = 0; k <= Dim; ++k) {
      bool sees = true;
      for (int d = 0; d < Dim; ++d) {
        const int at = v[d] + low[d] - 1;
        sees = sees && (at == corners[k][d] - 1 || at == corners[k][d]);
      }
      seen_by |= static_cast<unsigned>(sees) << k;
    }
    ++voxels[seen_by];
  }
  voxels.erase(0);
  Values<Dim> none;
  none.fill(-kHalf<Dim>);
  std::set<Values<Dim>> all{none};
  for (const auto& [seen_by, count] : voxels) {
    std::set<Values<Dim>> more;
    for (Values<Dim> f : all)
      for (int n = 0; n <= count; ++n) {
        more.insert(f);
        for (int k = 0; k <= Dim; ++k) f[k] += static_cast<int>(seen_by >> k & 1U);
      }
    all = std::move(more);
  }
  return all;
}

template <int Dim>
Spacetree<Dim> uniform_tree() {
  auto tree = testing::tree_of<Dim>({{"2"}, 1, {2}, 1, 1.0}, 1);
  Execution execution(1);
  tree.lattice.unit = Frame<Dim>::filled(1.0);
  return build_spacetree<Dim>(tree.lattice, testing::pattern_of<Dim>({"2"}), std::vector<std::uint8_t>(1 << Dim, 1), 1,
                              execution);
}

/// The worst angles of the template on a lattice of voxels with every filling of the voxels.
template <int Dim>
AngleRange worst_of_template() {
  Execution execution(1);
  const Mesh<Dim> mesh = tessellate_midpoint(uniform_tree<Dim>(), {}, execution);
  const CellBlock& block = mesh.blocks[0];
  AngleRange worst;
  for (std::int64_t i = 0; i < block.size(); ++i) {
    std::array<VertexId, Dim + 1> cell;
    std::copy_n(block.cell(i), Dim + 1, cell.begin());
    std::ranges::sort(cell);
    std::array<Vec<Dim>, Dim + 1> corners;
    std::array<Coord<Dim>, Dim + 1> lattice;
    for (int k = 0; k <= Dim; ++k) {
      corners[k] = mesh.points[cell[k]];
      for (int d = 0; d < Dim; ++d) lattice[k][d] = static_cast<std::int32_t>(corners[k][d]);
    }
    for (const Values<Dim>& f : possible_values<Dim>(lattice)) worst.merge(cut_angles<Dim>(corners, f));
  }
  return worst;
}

/// The simplices of random trees, each shape once: what is equal up to motions, scale and mirror images.
template <int Dim>
std::vector<std::array<Vec<Dim>, Dim + 1>> shapes(int balance) {
  std::map<std::vector<long>, std::array<Vec<Dim>, Dim + 1>> found;
  Execution execution(1);
  for (unsigned seed = 0; seed < 12; ++seed) {
    auto tree = testing::tree_of<Dim>({{"2", "2", "2"}, balance, {8}, seed, Dim == 2 ? 0.02 : 0.003}, 1);
    tree.lattice.unit = Frame<Dim>::filled(1.0);
    const Mesh<Dim> mesh = tessellate_midpoint(tree, {}, execution);
    const CellBlock& block = mesh.blocks[0];
    for (std::int64_t i = 0; i < block.size(); ++i) {
      std::array<Vec<Dim>, Dim + 1> x;
      for (int k = 0; k <= Dim; ++k) x[k] = mesh.points[block.cell(i)[k]];
      double shortest = 1e300;
      for (const auto& [a, b] : edge_ends<Dim>()) shortest = std::min(shortest, squared_norm(x[b] - x[a]));
      std::array<int, Dim + 1> order;
      std::iota(order.begin(), order.end(), 0);
      std::vector<long> key;
      do {
        std::vector<long> lengths;
        for (const auto& [a, b] : edge_ends<Dim>())
          lengths.push_back(std::lround(1e6 * squared_norm(x[order[b]] - x[order[a]]) / shortest));
        if (key.empty() || lengths < key) key = lengths;
      } while (std::ranges::next_permutation(order).found);
      found.emplace(key, x);
    }
  }
  std::vector<std::array<Vec<Dim>, Dim + 1>> all;
  for (const auto& [key, x] : found) all.push_back(x);
  return all;
}

/// The worst angles of a shape with any values at its corners and any order of its vertices.
template <int Dim>
AngleRange worst_of_shape(std::array<Vec<Dim>, Dim + 1> x) {
  AngleRange worst;
  std::array<int, Dim + 1> order;
  std::iota(order.begin(), order.end(), 0);
  do {
    std::array<Vec<Dim>, Dim + 1> corners;
    for (int k = 0; k <= Dim; ++k) corners[k] = x[order[k]];
    constexpr int kValues = 2 * kHalf<Dim> + 1;
    int total = 1;
    for (int k = 0; k <= Dim; ++k) total *= kValues;
    for (int code = 0; code < total; ++code) {
      Values<Dim> f;
      for (int k = 0, rest = code; k <= Dim; ++k, rest /= kValues) f[k] = rest % kValues - kHalf<Dim>;
      worst.merge(cut_angles<Dim>(corners, f));
    }
  } while (std::ranges::next_permutation(order).found);
  return worst;
}

double smallest(const AngleRange& r) { return kDegrees * std::acos(r.high); }
double largest(const AngleRange& r) { return kDegrees * std::acos(r.low); }

template <int Dim>
AngleRange worst_of_trees() {
  AngleRange worst;
  for (const auto& x : shapes<Dim>(1)) worst.merge(worst_of_shape<Dim>(x));
  return worst;
}

/// Marches without moving a vertex; the angles of the mesh.
template <int Dim>
DegreeRange marched_angles(Mesh<Dim> mesh, const MaterialField<Dim>& field) {
  Execution execution(1);
  mesh.labels = {0, 1};
  PaperMarchOptions<Dim> options;
  options.snap = 0;
  options.field = field;
  EXPECT_GT(march_materials(mesh, options, execution).cuts, 0);
  return measure_quality(mesh, Frame<Dim>{}, 0, execution).angles;
}

/// A mesh whose leaves have one of two materials at random.
template <int Dim>
Mesh<Dim> random_materials(const Spacetree<Dim>& given, unsigned seed) {
  Execution execution(1);
  Spacetree<Dim> tree = given;
  std::mt19937 random(seed);
  for (Leaf<Dim>& leaf : tree.leaves) leaf.material = static_cast<MaterialId>(random() % 2);
  return tessellate_midpoint(tree, {}, execution);
}

// The published bounds (docs/stages/march-paper.md), in degrees.
TEST(PaperBound, VoxelsCutInTemplates) {
  EXPECT_NEAR(smallest(worst_of_template<2>()), 18.435, 0.001);
  EXPECT_NEAR(largest(worst_of_template<2>()), 135, 0.001);
  EXPECT_NEAR(smallest(worst_of_template<3>()), 7.326, 0.001);
  EXPECT_NEAR(largest(worst_of_template<3>()), 166.367, 0.001);
}

TEST(PaperBound, BalancedTreesOfCubes) {
  EXPECT_NEAR(smallest(worst_of_trees<2>()), 10.305, 0.001);
  EXPECT_NEAR(largest(worst_of_trees<2>()), 153.435, 0.001);
  EXPECT_NEAR(smallest(worst_of_trees<3>()), 3.304, 0.001);
  EXPECT_NEAR(largest(worst_of_trees<3>()), 173.792, 0.001);
}

// What the method itself makes of noise keeps the bounds, under both functions, and comes close to them.
template <int Dim>
void noise_keeps_the_bound_of_templates(std::int32_t side, double least, double most, double slack) {
  Coord<Dim> extent;
  extent.fill(side);
  const auto image = testing::noise_image<Dim>(extent, 2, 5);
  Execution execution(1);
  const Field<Dim> linear = build_field(image, {.kind = FieldKind::linear}, execution);
  const Lattice<Dim> lattice{extent, Frame<Dim>::filled(1.0)};
  auto tree =
      build_spacetree<Dim>(lattice, testing::pattern_of<Dim>({}),
                           std::vector<std::uint8_t>(static_cast<std::size_t>(product(extent)), 0), 1, execution);
  for (Leaf<Dim>& leaf : tree.leaves) leaf.material = image.material(leaf.corner);
  const Mesh<Dim> mesh = tessellate_midpoint(tree, {}, execution);
  for (const auto& field : {MaterialField<Dim>{}, against_the_rest(linear)}) {
    const DegreeRange angles = marched_angles(mesh, field);
    EXPECT_GE(angles.min, least - 1e-3);
    EXPECT_LE(angles.min, least + slack);
    EXPECT_LE(angles.max, most + 1e-3);
    EXPECT_GE(angles.max, most - slack);
  }
}
TEST(PaperBound, NoiseKeepsTheBoundOfTemplates2D) { noise_keeps_the_bound_of_templates<2>(40, 18.435, 135, 1e-3); }
TEST(PaperBound, NoiseKeepsTheBoundOfTemplates3D) { noise_keeps_the_bound_of_templates<3>(16, 7.326, 166.367, 2); }

// Solid angles of cubes of any size are multiples of 1 / 2^Dim at every vertex of a tree.
TEST(PaperBound, NoiseOnTreesKeepsTheirBound) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    auto plane = testing::tree_of<2>({{"2", "2", "2"}, 1, {32}, seed, 0.05}, 1);
    plane.lattice.unit = Frame<2>::filled(1.0);
    const DegreeRange flat = marched_angles(random_materials(plane, seed), {});
    EXPECT_GE(flat.min, 10.305 - 1e-3);
    EXPECT_LE(flat.max, 153.435 + 1e-3);
    auto space = testing::tree_of<3>({{"2", "2", "2"}, 1, {16}, seed, 0.01}, 1);
    space.lattice.unit = Frame<3>::filled(1.0);
    const DegreeRange solid = marched_angles(random_materials(space, seed), {});
    EXPECT_GE(solid.min, 3.304 - 1e-3);
    EXPECT_LE(solid.max, 173.792 + 1e-3);
  }
}

}  // namespace
}  // namespace treemarch
