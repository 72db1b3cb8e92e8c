/// \file
/// Cells as simplices, for measuring. A cell with curved faces is measured as its split.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Corners of a simplex.
template <int Dim>
using Simplex = std::array<Vec<Dim>, Dim + 1>;

/// Tells which points a simplex contains.
template <int Dim>
class Barycentric {
 public:
  explicit Barycentric(const Simplex<Dim>& s) : simplex_(s), volume_(volume(s)) {}
  [[nodiscard]] bool is_valid() const { return volume_ != 0; }
  /// Whether all barycentric coordinates are at least -tolerance. \pre is_valid()
  [[nodiscard]] bool contains(const Vec<Dim>& x, double tolerance) const {
    for (int i = 0; i <= Dim; ++i)
      if (coordinate(x, i) < -tolerance) return false;
    return true;
  }
  /// The smallest barycentric coordinate: how deep a point lies in the simplex. \pre is_valid()
  [[nodiscard]] double depth(const Vec<Dim>& x) const {
    double least = coordinate(x, 0);
    for (int i = 1; i <= Dim; ++i) least = std::min(least, coordinate(x, i));
    return least;
  }
  /// One barycentric coordinate, 1 at that corner. \pre is_valid()
  [[nodiscard]] double coordinate(const Vec<Dim>& x, int corner) const {
    Simplex<Dim> s = simplex_;
    s[corner] = x;
    return volume(s) / volume_;
  }

 private:
  static double volume(const Simplex<Dim>& s) {
    std::array<Vec<Dim>, Dim> edges;
    for (int i = 0; i < Dim; ++i) edges[i] = s[i + 1] - s[0];
    return determinant<Dim>(edges);
  }
  Simplex<Dim> simplex_;
  double volume_;
};

/// Calls f(simplex) for the simplices that a cell is split into, each positive if the cell is.
template <int Dim, class F>
void for_each_simplex(const Mesh<Dim>& mesh, const CellBlock& block, std::int64_t cell, F&& f) {
  using Corners = std::array<int, Dim + 1>;
  const VertexId* v = block.cell(cell);
  const auto call = [&](const Corners& corners) {
    Simplex<Dim> s;
    for (int i = 0; i <= Dim; ++i) s[i] = mesh.points[v[corners[i]]];
    f(s);
  };
  if constexpr (Dim == 2) {
    call({0, 1, 2});
    if (block.type == CellType::quad) call({0, 2, 3});
  } else if constexpr (Dim == 4) {
    call({0, 1, 2, 3, 4});
  } else {
    switch (block.type) {
      case CellType::tetrahedron:
        call({0, 1, 2, 3});
        break;
      case CellType::pyramid:
        call({0, 1, 2, 4});
        call({0, 2, 3, 4});
        break;
      case CellType::hexahedron:
        call({0, 1, 3, 4});
        call({1, 2, 3, 6});
        call({1, 6, 3, 4});
        call({1, 6, 4, 5});
        call({3, 6, 7, 4});
        break;
      default:
        break;
    }
  }
}

}  // namespace treemarch
