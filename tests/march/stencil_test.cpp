// The proof of the bound: every undisplaced stencil of every shape that a lattice simplex can have.
#include "treemarch/march/stencil.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

template <int Dim>
using Shape = std::array<Coord<Dim>, Dim + 1>;  // first corner at the origin

// All shapes of lattice simplices, up to translation: a simplex lies in two leaves that share a face and touches those
// around one edge of it, so all refinements of 2 x 2 (x 2) roots show all shapes, at every place of the box too.
template <int Dim>
std::set<Shape<Dim>> lattice_shapes(bool refined) {
  std::set<Shape<Dim>> shapes;
  RefinementPattern<Dim> pattern;
  Coord<Dim> two{};
  two.fill(2);
  pattern.factors = {two};
  Lattice<Dim> lattice;
  lattice.extent.fill(4);
  lattice.unit.fill(1);
  Execution execution(1);
  constexpr int kRoots = 1 << Dim;
  for (unsigned split = refined ? 0 : (1U << kRoots) - 1; split < 1U << kRoots; ++split) {
    std::vector<std::uint8_t> level(product(lattice.extent));
    for (std::int64_t i = 0; i < product(lattice.extent); ++i) {
      const Coord<Dim> c = coord_of(i, lattice.extent);
      int root = 0;
      for (int d = 0; d < Dim; ++d) root |= (c[d] / 2) << d;
      level[i] = split >> root & 1;
    }
    const auto tree = build_spacetree<Dim>(lattice, pattern, level, 1, execution);
    const auto mesh = tessellate_body_centred<Dim>(tree, {}, execution);
    for (const auto& simplex : mesh.simplices) {
      Shape<Dim> shape{};
      bool hull = false;
      for (int k = 0; k <= Dim; ++k) {
        hull |= mesh.hull_axes(simplex[k]) != 0;
        for (int d = 0; d < Dim; ++d) shape[k][d] = mesh.vertices[simplex[k]][d] - mesh.vertices[simplex[0]][d];
      }
      if (refined || !hull) shapes.insert(shape);
    }
  }
  return shapes;
}

template <int Dim>
int squared_edge(const Shape<Dim>& shape, int edge) {
  int sum = 0;
  for (int d = 0; d < Dim; ++d) {
    const int e = shape[StencilTopology<Dim>::kEdge[edge][1]][d] - shape[StencilTopology<Dim>::kEdge[edge][0]][d];
    sum += e * e;
  }
  return sum;
}

// Patterns of diagonals that some total order of the keys gives.
template <int Dim>
std::set<unsigned> patterns_of(const Shape<Dim>& shape, unsigned cuts, bool long_first) {
  using T = StencilTopology<Dim>;
  std::set<unsigned> patterns;
  std::array<std::uint8_t, T::kEdges> order;
  std::iota(order.begin(), order.end(), std::uint8_t{0});
  do {
    bool admissible = true;
    for (int k = 0; long_first && k + 1 < T::kEdges; ++k)
      admissible &= squared_edge<Dim>(shape, order[k]) >= squared_edge<Dim>(shape, order[k + 1]);
    if (!admissible) continue;
    std::array<std::uint8_t, T::kEdges> rank;
    for (int k = 0; k < T::kEdges; ++k) rank[order[k]] = static_cast<std::uint8_t>(k);
    patterns.insert(stencil_pattern<Dim>(cuts, rank));
  } while (std::next_permutation(order.begin(), order.end()));
  return patterns;
}

// Undisplaced points: cuts in the middle, triple points and the inner point at the centroids.
template <int Dim>
std::array<Vec<Dim>, StencilTopology<Dim>::kPoints> undisplaced(const std::array<Vec<Dim>, Dim + 1>& corner) {
  using T = StencilTopology<Dim>;
  std::array<Vec<Dim>, T::kPoints> p{};
  for (int k = 0; k <= Dim; ++k) p[k] = corner[k];
  for (int e = 0; e < T::kEdges; ++e) p[T::kCut + e] = 0.5 * (corner[T::kEdge[e][0]] + corner[T::kEdge[e][1]]);
  for (int f = 0; f < T::kFaces; ++f)
    p[T::kTriple + f] = (1.0 / 3) * (corner[T::kFace[f][0]] + corner[T::kFace[f][1]] + corner[T::kFace[f][2]]);
  if constexpr (Dim == 3) p[T::kInner] = 0.25 * (corner[0] + corner[1] + corner[2] + corner[3]);
  return p;
}

struct Worst {
  double smallest = 180, largest = 0, quality = 180;
};

template <int Dim>
Worst worst_stencil(const std::set<Shape<Dim>>& shapes, bool long_first, const Vec<Dim>& stretch) {
  Worst worst;
  for (const auto& shape : shapes) {
    std::array<Vec<Dim>, Dim + 1> corner{};
    for (int k = 0; k <= Dim; ++k)
      for (int d = 0; d < Dim; ++d) corner[k][d] = shape[k][d] * stretch[d];
    const auto points = undisplaced<Dim>(corner);
    for (unsigned cuts = 0; cuts < 1U << StencilTopology<Dim>::kEdges; ++cuts)
      for (const unsigned pattern : patterns_of<Dim>(shape, cuts, long_first)) {
        const auto best = best_choice<Dim>(stencil<Dim>(pattern), points, true, QualityBound(90));
        EXPECT_FALSE(best.angles.inverted());
        worst.smallest = std::min(worst.smallest, std::acos(best.angles.high) * 180 / std::numbers::pi);
        worst.largest = std::max(worst.largest, std::acos(best.angles.low) * 180 / std::numbers::pi);
        worst.quality = std::min(worst.quality, quality(best.angles));
      }
  }
  return worst;
}

Vec<3> cube() { return {1, 1, 1}; }

TEST(stencil, uniform_lattice_keeps_30_degrees_for_any_order_of_the_keys) {
  const auto shapes = lattice_shapes<3>(false);
  EXPECT_EQ(shapes.size(), 12U);
  const Worst worst = worst_stencil<3>(shapes, false, cube());
  EXPECT_NEAR(worst.smallest, 30.0, 1e-9);
  EXPECT_NEAR(worst.largest, 144.7356, 1e-3);
}

TEST(stencil, trees_keep_18_degrees_with_long_edges_first) {
  const Worst worst = worst_stencil<3>(lattice_shapes<3>(true), true, cube());
  EXPECT_NEAR(worst.smallest, 18.4349, 1e-3);
  EXPECT_NEAR(worst.largest, 154.6482, 1e-3);
}

TEST(stencil, plane) {
  const Worst worst = worst_stencil<2>(lattice_shapes<2>(true), true, {1, 1});
  EXPECT_NEAR(worst.smallest, 18.4349, 1e-3);
  EXPECT_NEAR(worst.largest, 135.0000, 1e-3);
}

}  // namespace
}  // namespace treemarch
