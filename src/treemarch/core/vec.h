/// \file
/// Points, vectors and lattice coordinates of any dimension, as plain arrays.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace treemarch {

/// A point or vector of physical (or index) space.
template <int Dim>
using Vec = std::array<double, Dim>;

/// Integer coordinates: a voxel, a lattice cell or a lattice vertex. The first axis runs fastest in every array.
template <int Dim>
using Coord = std::array<std::int32_t, Dim>;

template <std::size_t N>
constexpr std::array<double, N> operator+(std::array<double, N> a, const std::array<double, N>& b) {
  for (std::size_t i = 0; i < N; ++i) a[i] += b[i];
  return a;
}

template <std::size_t N>
constexpr std::array<double, N> operator-(std::array<double, N> a, const std::array<double, N>& b) {
  for (std::size_t i = 0; i < N; ++i) a[i] -= b[i];
  return a;
}

template <std::size_t N>
constexpr std::array<double, N> operator*(double s, std::array<double, N> a) {
  for (std::size_t i = 0; i < N; ++i) a[i] *= s;
  return a;
}

template <std::size_t N>
constexpr double dot(const std::array<double, N>& a, const std::array<double, N>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

template <std::size_t N>
constexpr double squared_norm(const std::array<double, N>& a) {
  return dot(a, a);
}

template <std::size_t N>
double norm(const std::array<double, N>& a) {
  return std::sqrt(dot(a, a));
}

constexpr Vec<3> cross(const Vec<3>& a, const Vec<3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Product of the entries, in 64 bits: the number of cells of a grid of that extent.
template <class T, std::size_t N>
constexpr std::int64_t product(const std::array<T, N>& a) {
  std::int64_t p = 1;
  for (T v : a) p *= static_cast<std::int64_t>(v);
  return p;
}

/// Position of `c` in a dense array of the given extent, first axis fastest.
template <std::size_t N>
constexpr std::int64_t linear_index(const std::array<std::int32_t, N>& c, const std::array<std::int32_t, N>& extent) {
  std::int64_t i = 0;
  for (std::size_t d = N; d-- > 0;) i = i * extent[d] + c[d];
  return i;
}

/// Inverse of linear_index().
template <std::size_t N>
constexpr std::array<std::int32_t, N> coord_of(std::int64_t i, const std::array<std::int32_t, N>& extent) {
  std::array<std::int32_t, N> c{};
  for (std::size_t d = 0; d < N; ++d) {
    c[d] = static_cast<std::int32_t>(i % extent[d]);
    i /= extent[d];
  }
  return c;
}

}  // namespace treemarch
