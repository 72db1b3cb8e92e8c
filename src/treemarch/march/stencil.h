/// \file
/// How a lattice simplex is split by the cuts on its edges: the default method's rule, recursive in dimension.
/// See docs/stages/cut.md for the rule and for the proof of its bound.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {

/// Numbering of the points of a stencil: corners, then a cut an edge, then a triple point a triangle, then one inner
/// point (3D). Edges and triangles are in lexicographic order of their corners.
template <int Dim>
struct StencilTopology;

template <>
struct StencilTopology<2> {
  static constexpr int kCorners = 3, kEdges = 3, kFaces = 1, kCut = 3, kTriple = 6, kInner = 7, kPoints = 7;
  static constexpr std::uint8_t kEdge[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  static constexpr std::uint8_t kFace[1][3] = {{0, 1, 2}};
  static constexpr std::uint8_t kFaceEdge[1][3] = {{0, 1, 2}};  // in ascending order
};

template <>
struct StencilTopology<3> {
  static constexpr int kCorners = 4, kEdges = 6, kFaces = 4, kCut = 4, kTriple = 10, kInner = 14, kPoints = 15;
  static constexpr std::uint8_t kEdge[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  static constexpr std::uint8_t kFace[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
  static constexpr std::uint8_t kFaceEdge[4][3] = {{0, 1, 3}, {0, 2, 4}, {1, 2, 5}, {3, 4, 5}};
};

/// The pieces of one way to split a simplex.
template <int Dim>
using Pieces = std::vector<std::array<std::uint8_t, Dim + 1>>;

/// All admissible ways to split a simplex for one pattern of cuts and diagonals. They have the same facets on the
/// boundary.
template <int Dim>
struct Stencil {
  std::vector<Pieces<Dim>> choices;  ///< one an admissible apex; in 2D there is one
  std::vector<std::uint8_t> apex;    ///< the point that all pieces of a choice share
};

/// The pattern of a simplex: bit e is set where edge e is cut; bit kEdges + f where, in a triangle f with exactly two
/// cuts, the diagonal starts at the second of them. \param key_rank rank of each cut edge in the total order of the
/// keys.
template <int Dim>
unsigned stencil_pattern(unsigned cuts, const std::array<std::uint8_t, StencilTopology<Dim>::kEdges>& key_rank) {
  using T = StencilTopology<Dim>;
  unsigned pattern = cuts;
  for (int f = 0; f < T::kFaces; ++f) {
    int first = -1, second = -1, count = 0;
    for (const std::uint8_t e : T::kFaceEdge[f])
      if (cuts >> e & 1) (count++ == 0 ? first : second) = e;
    if (count == 2 && key_rank[second] < key_rank[first]) pattern |= 1U << (T::kEdges + f);
  }
  return pattern;
}

/// Corners of the triangle `face` (local points a, b, c in the orientation given) split by the cuts of the pattern: a
/// triangle without a cut stays; one cut halves it; two cut off a corner and a quadrilateral, whose diagonal starts at
/// the cut that the pattern names; three make a fan of six about the triple point.
template <int Dim>
void split_triangle(int face, unsigned pattern, std::vector<std::array<std::uint8_t, 3>>& out);

/// The stencil of a pattern. Built once; the reference stays valid.
template <int Dim>
const Stencil<Dim>& stencil(unsigned pattern);

/// The best way to split, by the worst angle of its pieces; none (-1) if all have an inverted or flat piece.
struct StencilChoice {
  int choice = -1;
  AngleRange angles{2, -2};
};

/// \param points positions of the points that the pattern uses.
/// \param inner whether the choice that fans from the inner point is offered; it is always offered with six cuts.
/// \param enough a choice that meets this bound is taken without looking at the rest.
template <int Dim>
StencilChoice best_choice(const Stencil<Dim>& stencil,
                          const std::array<Vec<Dim>, StencilTopology<Dim>::kPoints>& points, bool inner,
                          const QualityBound& enough);

}  // namespace treemarch
