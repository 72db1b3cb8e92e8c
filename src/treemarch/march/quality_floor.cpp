#include "treemarch/march/quality_floor.h"

#include <algorithm>
#include <numbers>
#include <numeric>

#include "treemarch/march/stencil.h"
#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

template <int Dim>
std::int64_t squared_edge(const LatticeShape<Dim>& shape, int edge) {
  std::int64_t sum = 0;
  for (int d = 0; d < Dim; ++d) {
    const std::int64_t e =
        shape[StencilTopology<Dim>::kEdge[edge][1]][d] - shape[StencilTopology<Dim>::kEdge[edge][0]][d];
    sum += e * e;
  }
  return sum;
}

/// The patterns of diagonals that some admissible order of the keys gives, for every pattern of cuts.
template <int Dim>
std::set<unsigned> patterns_of(const LatticeShape<Dim>& shape, bool long_first) {
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
    for (unsigned cuts = 0; cuts < 1U << T::kEdges; ++cuts) patterns.insert(stencil_pattern<Dim>(cuts, rank));
  } while (std::next_permutation(order.begin(), order.end()));
  return patterns;
}

template <int Dim>
std::array<Vec<Dim>, StencilTopology<Dim>::kPoints> undisplaced_points(const LatticeShape<Dim>& shape,
                                                                       const Vec<Dim>& sides) {
  using T = StencilTopology<Dim>;
  std::array<Vec<Dim>, T::kPoints> p{};
  for (int k = 0; k <= Dim; ++k)
    for (int d = 0; d < Dim; ++d) p[k][d] = shape[k][d] * sides[d];
  for (int e = 0; e < T::kEdges; ++e) p[T::kCut + e] = 0.5 * (p[T::kEdge[e][0]] + p[T::kEdge[e][1]]);
  for (int f = 0; f < T::kFaces; ++f)
    p[T::kTriple + f] = (1.0 / 3) * (p[T::kFace[f][0]] + p[T::kFace[f][1]] + p[T::kFace[f][2]]);
  if constexpr (Dim == 3) p[T::kInner] = 0.25 * (p[0] + p[1] + p[2] + p[3]);
  return p;
}

}  // namespace

template <int Dim>
std::set<LatticeShape<Dim>> lattice_shapes(bool graded) {
  std::set<LatticeShape<Dim>> shapes;
  Coord<Dim> two{};
  two.fill(2);
  Lattice<Dim> lattice;
  lattice.extent.fill(4);
  lattice.unit.fill(1);
  Execution execution(1);
  constexpr unsigned kAllSplit = (1U << (1 << Dim)) - 1;
  for (unsigned split = graded ? 0 : kAllSplit; split <= kAllSplit; ++split) {
    std::vector<std::uint8_t> level(product(lattice.extent));
    for (std::int64_t i = 0; i < product(lattice.extent); ++i) {
      const Coord<Dim> c = coord_of(i, lattice.extent);
      int root = 0;
      for (int d = 0; d < Dim; ++d) root |= (c[d] / 2) << d;
      level[i] = split >> root & 1;
    }
    const auto tree = build_spacetree<Dim>(lattice, {{two}}, level, 1, execution);
    const auto mesh = tessellate_body_centred<Dim>(tree, execution);
    std::array<typename LeafStar<Dim>::Simplex, LeafStar<Dim>::kMostSimplices> simplices;
    for (std::size_t leaf = 0; leaf < mesh.leaves.size(); ++leaf) {
      const int count = mesh.star(static_cast<LeafId>(leaf)).simplices(simplices);
      for (const auto& simplex : std::span(simplices).first(count)) {
        LatticeShape<Dim> shape{};
        bool hull = false;
        for (int k = 0; k <= Dim; ++k) {
          hull |= mesh.hull_axes(simplex[k]) != 0;
          for (int d = 0; d < Dim; ++d) shape[k][d] = mesh.vertices[simplex[k]][d] - mesh.vertices[simplex[0]][d];
        }
        if (graded || !hull) shapes.insert(shape);
      }
    }
  }
  return shapes;
}

template <int Dim>
StencilBound worst_stencil(const std::set<LatticeShape<Dim>>& shapes, bool long_first, const Vec<Dim>& sides) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  StencilBound worst;
  for (const auto& shape : shapes) {
    const auto points = undisplaced_points<Dim>(shape, sides);
    for (const unsigned pattern : patterns_of<Dim>(shape, long_first)) {
      const auto best = best_choice<Dim>(stencil<Dim>(pattern), points, true, QualityBound(90));
      worst.quality = std::min(worst.quality, quality(best.angles));
      worst.smallest_angle = std::min(worst.smallest_angle, std::acos(std::min(1.0, best.angles.high)) * kDegrees);
      worst.largest_angle = std::max(worst.largest_angle, std::acos(std::max(-1.0, best.angles.low)) * kDegrees);
    }
  }
  return worst;
}

template <int Dim>
double guaranteed_quality(const Vec<Dim>& sides) {
  return worst_stencil<Dim>(lattice_shapes<Dim>(true), true, sides).quality;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                           \
  template std::set<LatticeShape<DIM>> lattice_shapes<DIM>(bool);                                            \
  template StencilBound worst_stencil<DIM>(const std::set<LatticeShape<DIM>>&, bool, const Vec<DIM>& sides); \
  template double guaranteed_quality<DIM>(const Vec<DIM>&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
