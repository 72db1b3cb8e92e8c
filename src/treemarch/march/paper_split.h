/// \file
/// How a simplex falls apart along a separating surface: all cases (n+, n0, n-) of any dimension (paper figure 4).
#pragma once

#include <array>
#include <cstdint>

namespace treemarch {

/// The corners of a simplex are numbered 0..Dim in the order of their vertex ids, its edges lexicographically:
/// (0,1), (0,2), ..., (Dim-1,Dim). These are the ends of each edge.
template <int Dim>
constexpr std::array<std::array<std::uint8_t, 2>, Dim*(Dim + 1) / 2> edge_ends() {
  std::array<std::array<std::uint8_t, 2>, Dim*(Dim + 1) / 2> ends{};
  std::size_t e = 0;
  for (int a = 0; a < Dim; ++a) {
    for (int b = a + 1; b <= Dim; ++b) ends[e++] = {static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b)};
  }
  return ends;
}

/// The pieces of one simplex.
template <int Dim>
struct SimplexSplit {
  struct Piece {
    /// A corner c <= Dim is that of the simplex, c > Dim the cut point of edge c - Dim - 1. Positively oriented if the
    /// simplex is.
    std::array<std::uint8_t, Dim + 1> corners;
    std::int8_t side;  ///< sign of f in the piece; 0 only where f vanishes at all corners
  };
  /// (1,0,2) in 2D, (2,0,2) in 3D, (2,0,3) in 4D.
  static constexpr int kMaxPieces = Dim == 2 ? 3 : Dim == 3 ? 6 : 10;
  int count = 0;
  std::array<Piece, kMaxPieces> pieces{};

  [[nodiscard]] const Piece* begin() const { return pieces.data(); }
  [[nodiscard]] const Piece* end() const { return pieces.data() + count; }
};

/// The split of a simplex with these signs (-1, 0, 1) of f at its corners, ordered by vertex id. A simplex without both
/// signs is one piece.
///
/// Each side is triangulated by pulling: its first corner is joined to the triangulated facets that do not contain it,
/// corners of the simplex before cut points, cut points in the order of their edges. What a face of the simplex shows
/// depends on the face alone, so that neighbours agree; so do the two sides along the surface. Dim is 2, 3 or 4.
template <int Dim>
const SimplexSplit<Dim>& simplex_split(const std::array<std::int8_t, Dim + 1>& signs);

/// What the surface cuts out of a simplex, as simplices of one dimension less.
template <int Dim>
struct SimplexSlice {
  static constexpr int kMaxPieces = Dim - 1;  ///< a prism over a simplex
  int count = 0;
  /// Corners as in SimplexSplit, in such an order that a piece followed by a point where f > 0 is positive if the
  /// simplex is.
  std::array<std::array<std::uint8_t, Dim>, kMaxPieces> pieces{};

  [[nodiscard]] const std::array<std::uint8_t, Dim>* begin() const { return pieces.data(); }
  [[nodiscard]] const std::array<std::uint8_t, Dim>* end() const { return pieces.data() + count; }
};

/// The section along the surface by the same rule, of a simplex with both signs; or the facet on the surface of one
/// with a single corner off it. Everything else has no section of its own. Dim is 3 or 4.
template <int Dim>
const SimplexSlice<Dim>& simplex_slice(const std::array<std::int8_t, Dim + 1>& signs);

}  // namespace treemarch
