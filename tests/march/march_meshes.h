/// \file
/// Labelled meshes for the tests of marching and smoothing.
#pragma once

#include <cstdint>
#include <random>

#include "support/meshes.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch::testing {

/// Independent random labels 1..labels of the grid cells.
template <int Dim>
Mesh<Dim> noise_mesh(int side, int labels, unsigned seed) {
  std::mt19937 random(seed);
  Coord<Dim> extent;
  extent.fill(side);
  return box_mesh<Dim>(extent, [&](const Coord<Dim>&) {
    return static_cast<std::int32_t>(random() % static_cast<unsigned>(labels)) + 1;
  });
}

/// A ball in the middle of a cube of `side` unit cells: 1 outside, 2 and (for x above the middle) 2 + halves inside.
template <int Dim>
Mesh<Dim> ball_mesh(int side, double radius, int halves = 0) {
  Coord<Dim> extent;
  extent.fill(side);
  return box_mesh<Dim>(extent, [&](const Coord<Dim>& c) {
    double r2 = 0;
    for (const auto i : c) r2 += (i + 0.5 - side / 2.0) * (i + 0.5 - side / 2.0);
    return r2 > radius * radius ? 1 : 2 + (c[0] >= side / 2 ? halves : 0);
  });
}

/// Moves every vertex off the hull by up to `amount` in each direction.
template <int Dim>
void jitter(Mesh<Dim>& mesh, double amount, double side, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> shift(-amount, amount);
  for (auto& x : mesh.points) {
    for (auto& c : x) {
      const double s = shift(random);
      if (c > 0 && c < side) c += s;
    }
  }
}

}  // namespace treemarch::testing
