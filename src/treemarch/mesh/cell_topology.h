/// \file
/// Facets and corners of the cell types, as tables: what differs between dimensions and shapes is data, not code.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Vertices of one facet as positions within the cell.
struct LocalFacet {
  std::uint8_t size;
  std::array<std::uint8_t, 4> vertex;
};

/// A facet lists its vertices so that its normal points out of a positive cell: seen counter-clockwise from outside in
/// 3D; in any dimension det(normal, v1 - v0, v2 - v0, ...) > 0. The two facets of a line are points: the end, then the
/// start.
/// A corner is a vertex with its edge neighbours, in an order that makes it a positive simplex in a valid cell. (The
/// apex of a pyramid has four and is left out.) Simplices have one corner: themselves.
struct CellTopology {
  int facet_count;
  std::array<LocalFacet, 6> facets;
  int corner_count;
  std::array<std::array<std::uint8_t, 5>, 8> corners;
};

inline constexpr std::array<CellTopology, 7> kCellTopology{{
    {2, {{{1, {1}}, {1, {0}}}}, 1, {{{0, 1}}}},                        // line
    {3, {{{2, {1, 2}}, {2, {2, 0}}, {2, {0, 1}}}}, 1, {{{0, 1, 2}}}},  // triangle
    {4,                                                                // quad
     {{{2, {0, 1}}, {2, {1, 2}}, {2, {2, 3}}, {2, {3, 0}}}},
     4,
     {{{0, 1, 3}, {1, 2, 0}, {2, 3, 1}, {3, 0, 2}}}},
    {4,  // tetrahedron
     {{{3, {1, 2, 3}}, {3, {0, 3, 2}}, {3, {0, 1, 3}}, {3, {0, 2, 1}}}},
     1,
     {{{0, 1, 2, 3}}}},
    {5,  // pyramid
     {{{4, {0, 3, 2, 1}}, {3, {0, 1, 4}}, {3, {1, 2, 4}}, {3, {2, 3, 4}}, {3, {3, 0, 4}}}},
     4,
     {{{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}}}},
    {6,  // hexahedron
     {{{4, {0, 3, 2, 1}},
       {4, {4, 5, 6, 7}},
       {4, {0, 1, 5, 4}},
       {4, {1, 2, 6, 5}},
       {4, {2, 3, 7, 6}},
       {4, {3, 0, 4, 7}}}},
     8,
     {{{0, 1, 3, 4},
       {1, 2, 0, 5},
       {2, 3, 1, 6},
       {3, 0, 2, 7},
       {4, 7, 5, 0},
       {5, 4, 6, 1},
       {6, 5, 7, 2},
       {7, 6, 4, 3}}}},
    {5,  // pentatope
     {{{4, {1, 2, 3, 4}}, {4, {0, 2, 4, 3}}, {4, {0, 1, 3, 4}}, {4, {0, 1, 4, 2}}, {4, {0, 1, 2, 3}}}},
     1,
     {{{0, 1, 2, 3, 4}}}},
}};

[[nodiscard]] constexpr const CellTopology& topology(CellType type) { return kCellTopology[static_cast<int>(type)]; }

/// Calls f(vertex, next, previous) for each vertex of a facet of a cell, with its neighbours along the facet's rim (2D:
/// the same one twice).
template <class F>
void for_each_corner(const LocalFacet& facet, const VertexId* cell, F&& f) {
  for (int k = 0; k < facet.size; ++k)
    f(cell[facet.vertex[k]], cell[facet.vertex[k + 1 < facet.size ? k + 1 : 0]],
      cell[facet.vertex[k > 0 ? k - 1 : facet.size - 1]]);
}

inline constexpr std::array<std::array<std::uint8_t, 8>, 7> kMirroredOrder{
    {{1, 0}, {1, 0, 2}, {0, 3, 2, 1}, {1, 0, 2, 3}, {0, 3, 2, 1, 4}, {4, 5, 6, 7, 0, 1, 2, 3}, {1, 0, 2, 3, 4}}};

/// The order of the vertices that makes a cell positive again after space was mirrored; an involution.
[[nodiscard]] constexpr const std::array<std::uint8_t, 8>& mirrored_order(CellType type) {
  return kMirroredOrder[static_cast<int>(type)];
}

/// Determinant of a matrix given by its rows.
template <int Dim>
[[nodiscard]] constexpr double determinant(const std::array<Vec<Dim>, Dim>& m) {
  if constexpr (Dim == 1) {
    return m[0][0];
  } else if constexpr (Dim == 2) {
    return m[0][0] * m[1][1] - m[0][1] * m[1][0];
  } else if constexpr (Dim == 3) {
    return dot(cross(m[0], m[1]), m[2]);
  } else {
    double sum = 0;
    for (int c = 0; c < Dim; ++c) {
      std::array<Vec<Dim - 1>, Dim - 1> minor{};
      for (int r = 1; r < Dim; ++r)
        for (int k = 0, to = 0; k < Dim; ++k)
          if (k != c) minor[r - 1][to++] = m[r][k];
      sum += (c % 2 ? -1 : 1) * m[0][c] * determinant<Dim - 1>(minor);
    }
    return sum;
  }
}

/// Dim! times the signed volume of the simplex `points[v[0]], ..., points[v[Dim]]`.
template <int Dim, class Index>
[[nodiscard]] double simplex_determinant(const Vec<Dim>* points, const Index* v) {
  std::array<Vec<Dim>, Dim> edges;
  for (int i = 0; i < Dim; ++i) edges[i] = points[v[i + 1]] - points[v[0]];
  return determinant<Dim>(edges);
}

/// Signed volume (area, length) of a cell. Where four corners of a face are not in one plane, the face is the bilinear
/// one, which lies in the middle between its two ways of being split: so neighbours agree and volumes add up.
/// \pre dimension(type) == Dim.
template <int Dim>
[[nodiscard]] double cell_volume(const Vec<Dim>* points, CellType type, const VertexId* v) {
  constexpr double kFactorial[] = {1, 1, 2, 6, 24};
  auto part = [&](std::array<int, 5> local) {
    std::array<VertexId, 5> s{};
    for (int i = 0; i <= Dim; ++i) s[i] = v[local[i]];
    return simplex_determinant<Dim>(points, s.data());
  };
  double sum = 0;
  if (type == CellType::quad) {
    sum = part({0, 1, 2}) + part({0, 2, 3});
  } else if (type == CellType::pyramid) {
    sum = part({0, 1, 2, 4}) + part({0, 2, 3, 4}) + part({0, 1, 3, 4}) + part({1, 2, 3, 4});
    sum /= 2;
  } else if (type == CellType::hexahedron) {
    sum = part({0, 1, 3, 4}) + part({1, 2, 3, 6}) + part({1, 6, 3, 4}) + part({1, 6, 4, 5}) + part({3, 4, 6, 7}) +
          part({1, 2, 0, 5}) + part({0, 2, 3, 7}) + part({0, 5, 2, 7}) + part({0, 5, 7, 4}) + part({2, 7, 5, 6});
    sum /= 2;
  } else {
    sum = part({0, 1, 2, 3, 4});
  }
  return sum / kFactorial[Dim];
}

/// The determinants of the edges at the corners of a cell, over the product of their lengths: 1 where they are at right
/// angles, 0 where they are in one plane, negative where the corner is inverted. A simplex has one corner, the apex of
/// a pyramid has none.
struct CornerJacobians {
  double min_scaled = 2;    ///< the smallest of them: the scaled Jacobian
  double min = 0, max = 0;  ///< of the determinants themselves

  /// The smallest determinant over the largest: 1 for a parallelepiped.
  [[nodiscard]] double ratio() const { return max > 0 ? min / max : -1; }
};

/// \pre dimension(type) == Dim.
template <int Dim>
[[nodiscard]] CornerJacobians corner_jacobians(const std::array<Vec<Dim>, 8>& points, CellType type) {
  CornerJacobians j;
  const CellTopology& shape = topology(type);
  for (int c = 0; c < shape.corner_count; ++c) {
    std::array<Vec<Dim>, Dim> edges;
    double lengths = 1;
    for (int i = 0; i < Dim; ++i) {
      edges[i] = points[shape.corners[c][i + 1]] - points[shape.corners[c][0]];
      lengths *= norm(edges[i]);
    }
    const double d = determinant<Dim>(edges);
    j.min_scaled = std::min(j.min_scaled, lengths > 0 ? d / lengths : 0);
    j.min = c == 0 ? d : std::min(j.min, d);
    j.max = c == 0 ? d : std::max(j.max, d);
  }
  return j;
}

}  // namespace treemarch
