#include "treemarch/march/solid_angle.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <tuple>

#include "treemarch/mesh/cell_topology.h"

namespace treemarch {

namespace {

/// The other ends of the Dim edges that leave a corner of a simplex, in positive order.
template <int Dim>
constexpr std::array<std::array<std::uint8_t, Dim>, Dim + 1> simplex_edges() {
  if constexpr (Dim == 2) {
    return {{{1, 2}, {2, 0}, {0, 1}}};
  } else {
    return {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
  }
}

}  // namespace

double cone_ratio(const Vec<2>& a, const Vec<2>& b) {
  return std::atan2(a[0] * b[1] - a[1] * b[0], dot(a, b)) / (2 * std::numbers::pi);
}

// tan(angle / 2) of a trihedral cone as a quotient of the triple product (van Oosterom and Strackee 1983).
double cone_ratio(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const double la = norm(a);
  const double lb = norm(b);
  const double lc = norm(c);
  const double denominator = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  return std::atan2(dot(a, cross(b, c)), denominator) / (2 * std::numbers::pi);
}

template <int Dim>
double solid_angle_ratio(CellType type, const VertexId* cell, int corner, std::span<const Vec<Dim>> points) {
  const Vec<Dim>& origin = points[cell[corner]];
  const auto cone = [&](auto... ends) { return cone_ratio((points[cell[ends]] - origin)...); };
  if (type == kSimplex<Dim>) {
    const auto e = simplex_edges<Dim>()[corner];
    return std::apply(cone, e);
  }
  if (type == CellType::pyramid && corner == 4) {
    if constexpr (Dim == 3) return cone(0, 3, 2) + cone(0, 2, 1);
  }
  const auto& edges = topology(type).corners[corner];
  if constexpr (Dim == 2) {
    return cone(edges[1], edges[2]);
  } else {
    return cone(edges[1], edges[2], edges[3]);
  }
}

template double solid_angle_ratio<2>(CellType, const VertexId*, int, std::span<const Vec<2>>);
template double solid_angle_ratio<3>(CellType, const VertexId*, int, std::span<const Vec<3>>);

}  // namespace treemarch
