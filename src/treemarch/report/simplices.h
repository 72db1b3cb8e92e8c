/// \file
/// Cells as simplices, for measuring. A cell with curved faces is measured as its split.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Corners of a simplex.
template <int Dim>
using Simplex = std::array<Vec<Dim>, Dim + 1>;

/// Signed area (2D) or volume (3D), positive for a positive simplex.
template <int Dim>
double signed_volume(const Simplex<Dim>& s) {
  if constexpr (Dim == 2) {
    const Vec<2> a = s[1] - s[0], b = s[2] - s[0];
    return (a[0] * b[1] - a[1] * b[0]) / 2;
  } else {
    static_assert(Dim == 3);
    return dot(cross(s[1] - s[0], s[2] - s[0]), s[3] - s[0]) / 6;
  }
}

/// Tells which points a simplex contains.
template <int Dim>
class Barycentric {
 public:
  explicit Barycentric(const Simplex<Dim>& s) : simplex_(s), volume_(signed_volume(s)) {}
  [[nodiscard]] bool is_valid() const { return volume_ != 0; }
  /// Whether all barycentric coordinates are at least -tolerance. \pre is_valid()
  [[nodiscard]] bool contains(const Vec<Dim>& x, double tolerance) const {
    for (int i = 0; i <= Dim; ++i) {
      Simplex<Dim> s = simplex_;
      s[i] = x;
      if (signed_volume(s) / volume_ < -tolerance) return false;
    }
    return true;
  }

 private:
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
