/// \file
/// The measure of a simplex that the default method guarantees: its angles, kept as cosines so that a comparison costs
/// no inverse function. Angles are those between facets: of the triangle in 2D, dihedral in 3D and 4D.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {

/// Cosines of the smallest (`high`) and the largest (`low`) angle of one or several simplices. An inverted or flat
/// simplex has high = 2.
struct AngleRange {
  double high = -1, low = 1;

  void merge(const AngleRange& other) {
    high = std::max(high, other.high);
    low = std::min(low, other.low);
  }
  [[nodiscard]] bool inverted() const { return high > 1; }
};

/// Normals of the facets of a simplex opposite to each vertex, of a length of (Dim - 1)! times their measure: the
/// gradients of its barycentric coordinates times its simplex_determinant(). They point inwards if it is positive.
template <int Dim>
[[nodiscard]] std::array<Vec<Dim>, Dim + 1> inward_normals(const std::array<Vec<Dim>, Dim + 1>& p) {
  std::array<Vec<Dim>, Dim> edges{};
  for (int k = 1; k <= Dim; ++k) edges[k - 1] = p[k] - p[0];
  std::array<Vec<Dim>, Dim + 1> n{};
  for (int i = 1; i <= Dim; ++i) {
    if constexpr (Dim == 3) {
      n[i] = cross(edges[i % 3], edges[(i + 1) % 3]);
    } else {
      for (int d = 0; d < Dim; ++d) {
        auto replaced = edges;
        replaced[i - 1] = {};
        replaced[i - 1][d] = 1;
        n[i][d] = determinant<Dim>(replaced);
      }
    }
    n[0] = n[0] - n[i];
  }
  return n;
}

namespace detail {

inline AngleRange angles(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  const Vec<2> u = b - a, v = c - a, w = c - b;
  if (!(u[0] * v[1] - u[1] * v[0] > 0)) return {2, -2};
  const double uu = dot(u, u), vv = dot(v, v), ww = dot(w, w);
  const double at_a = dot(u, v) / std::sqrt(uu * vv), at_b = -dot(u, w) / std::sqrt(uu * ww),
               at_c = dot(v, w) / std::sqrt(vv * ww);
  return {std::max({at_a, at_b, at_c}), std::min({at_a, at_b, at_c})};
}

inline AngleRange angles(const Vec<3>& p0, const Vec<3>& p1, const Vec<3>& p2, const Vec<3>& p3) {
  const Vec<3> a = p1 - p0, b = p2 - p0, c = p3 - p0;
  // Inward normals of the faces opposite to the vertices.
  const Vec<3> n1 = cross(b, c), n2 = cross(c, a), n3 = cross(a, b);
  if (!(dot(a, n1) > 0)) return {2, -2};
  const Vec<3> n0{-n1[0] - n2[0] - n3[0], -n1[1] - n2[1] - n3[1], -n1[2] - n2[2] - n3[2]};
  const double s0 = 1 / std::sqrt(dot(n0, n0)), s1 = 1 / std::sqrt(dot(n1, n1)), s2 = 1 / std::sqrt(dot(n2, n2)),
               s3 = 1 / std::sqrt(dot(n3, n3));
  const double c01 = dot(n0, n1) * s0 * s1, c02 = dot(n0, n2) * s0 * s2, c03 = dot(n0, n3) * s0 * s3,
               c12 = dot(n1, n2) * s1 * s2, c13 = dot(n1, n3) * s1 * s3, c23 = dot(n2, n3) * s2 * s3;
  return {-std::min({c01, c02, c03, c12, c13, c23}), -std::max({c01, c02, c03, c12, c13, c23})};
}

inline AngleRange angles(const std::array<Vec<4>, 5>& p) {
  const std::array<Vec<4>, 5> n = inward_normals<4>(p);
  if (!(dot(p[1] - p[0], n[1]) > 0)) return {2, -2};
  AngleRange range;
  for (int i = 0; i <= 4; ++i) {
    for (int j = 0; j < i; ++j) {
      const double cosine = -dot(n[i], n[j]) / std::sqrt(squared_norm(n[i]) * squared_norm(n[j]));
      range.merge({cosine, cosine});
    }
  }
  return range;
}

}  // namespace detail

/// Angles of a simplex given by its Dim + 1 points.
template <int Dim>
AngleRange angle_range(const std::array<Vec<Dim>, Dim + 1>& p) {
  if constexpr (Dim == 2)
    return detail::angles(p[0], p[1], p[2]);
  else if constexpr (Dim == 4)
    return detail::angles(p);
  else
    return detail::angles(p[0], p[1], p[2], p[3]);
}

/// q = min(smallest angle, 0.8 * (180 - largest angle)) in degrees: q >= 20 means no angle below 20 or above 155.
/// -1 if a simplex is inverted.
inline double quality(const AngleRange& r) {
  if (r.inverted()) return -1;
  constexpr double kDegrees = 180 / std::numbers::pi;
  return kDegrees * std::min(std::acos(std::clamp(r.high, -1.0, 1.0)), 0.8 * std::acos(std::clamp(-r.low, -1.0, 1.0)));
}

/// The same measure as a number that needs no inverse function and grows with q: the quality is at least `degrees`
/// exactly if meets(range, QualityBound(degrees)).
struct QualityBound {
  explicit QualityBound(double degrees)
      : high(std::cos(degrees * std::numbers::pi / 180)), low(-std::cos(degrees / 0.8 * std::numbers::pi / 180)) {}
  double high, low;
};
[[nodiscard]] inline bool meets(const AngleRange& r, const QualityBound& bound) {
  return r.high <= bound.high && r.low >= bound.low;
}

/// A bound for simplices that are tested without a root or a quotient; rounding may decide at the bound itself.
/// \pre degrees is below 72: both cosines are those of angles below 90 degrees (of 180 - the largest angle).
struct SquaredQualityBound {
  explicit SquaredQualityBound(const QualityBound& bound) : high(bound.high * bound.high), low(bound.low * bound.low) {}
  double high, low;
};

namespace detail {

/// The same for a simplex given by its edges from one vertex to the others. T is double, or a vector type of several of
/// them; then the result is a vector of masks. The same bits for all of them.
template <class T>
[[nodiscard, gnu::always_inline]] inline auto edges_meet(const std::array<std::array<T, 3>, 3>& edges,
                                                         const SquaredQualityBound& bound) {
  using Vector = std::array<T, 3>;
  const auto product = [](const Vector& u, const Vector& v) [[gnu::always_inline]] -> Vector {
    return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  };
  const auto scalar = [](const Vector& u, const Vector& v)
                          [[gnu::always_inline]] { return T(u[0] * v[0] + u[1] * v[1] + u[2] * v[2]); };
  const auto within = [&](const Vector& n, const Vector& m, const T& s) [[gnu::always_inline]] {
    const T d = scalar(n, m), square = d * (d < 0 ? -d : d);
    return (square >= -bound.high * s) & (square <= bound.low * s);
  };
  const Vector n1 = product(edges[1], edges[2]), n2 = product(edges[2], edges[0]), n3 = product(edges[0], edges[1]);
  const Vector n0{-n1[0] - n2[0] - n3[0], -n1[1] - n2[1] - n3[1], -n1[2] - n2[2] - n3[2]};
  const T s0 = scalar(n0, n0), s1 = scalar(n1, n1), s2 = scalar(n2, n2), s3 = scalar(n3, n3);
  return (scalar(edges[0], n1) > 0) & within(n0, n1, s0 * s1) & within(n0, n2, s0 * s2) & within(n0, n3, s0 * s3) &
         within(n1, n2, s1 * s2) & within(n1, n3, s1 * s3) & within(n2, n3, s2 * s3);
}
template <class T>
[[nodiscard, gnu::always_inline]] inline auto edges_meet(const std::array<std::array<T, 2>, 2>& edges,
                                                         const SquaredQualityBound& bound) {
  const auto& [u, v] = edges;
  const std::array<T, 2> w{v[0] - u[0], v[1] - u[1]};
  const T uu = u[0] * u[0] + u[1] * u[1], vv = v[0] * v[0] + v[1] * v[1], ww = w[0] * w[0] + w[1] * w[1];
  const T at_first = u[0] * v[0] + u[1] * v[1], at_second = -(u[0] * w[0] + u[1] * w[1]),
          at_third = v[0] * w[0] + v[1] * w[1];
  const auto within = [&](const T& d, const T& s) [[gnu::always_inline]] {
    const T square = d * (d < 0 ? -d : d);
    return (square <= bound.high * s) & (-square <= bound.low * s);
  };
  return (u[0] * v[1] - u[1] * v[0] > 0) & within(at_first, uu * vv) & within(at_second, uu * ww) &
         within(at_third, vv * ww);
}

}  // namespace detail

template <std::size_t Points>
[[nodiscard, gnu::always_inline]] inline bool meets(const std::array<Vec<int(Points) - 1>, Points>& p,
                                                    const SquaredQualityBound& bound) {
  std::array<std::array<double, Points - 1>, Points - 1> edges;
  for (std::size_t k = 1; k < Points; ++k) edges[k - 1] = p[k] - p[0];
  return detail::edges_meet(edges, bound) != 0;
}

}  // namespace treemarch
