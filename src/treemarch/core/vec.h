/// \file
/// Points, vectors and lattice coordinates of any dimension, as plain arrays.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace treemarch {

/// A point or vector of physical (or index) space.
// A type of its own, not an alias, so that the dimension can be deduced from an argument.
template <int Dim>
struct Vec : std::array<double, static_cast<std::size_t>(Dim)> {};

/// Integer coordinates: a voxel, a lattice cell or a lattice vertex. The first axis runs fastest in every array.
template <int Dim>
struct Coord : std::array<std::int32_t, static_cast<std::size_t>(Dim)> {};

template <int Dim>
constexpr Vec<Dim> operator+(Vec<Dim> a, const Vec<Dim>& b) {
  for (int i = 0; i < Dim; ++i) a[i] += b[i];
  return a;
}

template <int Dim>
constexpr Vec<Dim> operator-(Vec<Dim> a, const Vec<Dim>& b) {
  for (int i = 0; i < Dim; ++i) a[i] -= b[i];
  return a;
}

template <int Dim>
constexpr Vec<Dim> operator*(double s, Vec<Dim> a) {
  for (double& x : a) x *= s;
  return a;
}

template <int Dim>
constexpr double dot(const Vec<Dim>& a, const Vec<Dim>& b) {
  double sum = 0;
  for (int i = 0; i < Dim; ++i) sum += a[i] * b[i];
  return sum;
}

template <int Dim>
constexpr double squared_norm(const Vec<Dim>& a) {
  return dot(a, a);
}

template <int Dim>
double norm(const Vec<Dim>& a) {
  return std::sqrt(dot(a, a));
}

constexpr Vec<3> cross(const Vec<3>& a, const Vec<3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Product of the entries, in 64 bits: the number of cells of a grid of that extent.
template <int Dim>
constexpr std::int64_t product(const Coord<Dim>& a) {
  std::int64_t p = 1;
  for (std::int32_t v : a) p *= v;
  return p;
}

/// Position of `c` in a dense array of the given extent, first axis fastest.
template <int Dim>
constexpr std::int64_t linear_index(const Coord<Dim>& c, const Coord<Dim>& extent) {
  std::int64_t i = 0;
  for (int d = Dim; d-- > 0;) i = i * extent[d] + c[d];
  return i;
}

/// Inverse of linear_index().
template <int Dim>
constexpr Coord<Dim> coord_of(std::int64_t i, const Coord<Dim>& extent) {
  Coord<Dim> c{};
  for (int d = 0; d < Dim; ++d) {
    c[d] = static_cast<std::int32_t>(i % extent[d]);
    i /= extent[d];
  }
  return c;
}

}  // namespace treemarch
