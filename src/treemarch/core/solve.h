/// \file
/// Small systems of linear equations.
#pragma once

#include <array>

#include "treemarch/core/vec.h"

namespace treemarch {

/// Solves the symmetric positive definite system m y = r, by elimination without pivots.
template <int Dim>
Vec<Dim> solve_definite(std::array<Vec<Dim>, Dim> m, Vec<Dim> r) {
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j) {
      const double f = m[j][i] / m[i][i];
      for (int k = i; k < Dim; ++k) m[j][k] -= f * m[i][k];
      r[j] -= f * r[i];
    }
  for (int i = Dim; i-- > 0;) {
    for (int k = i + 1; k < Dim; ++k) r[i] -= m[i][k] * r[k];
    r[i] /= m[i][i];
  }
  return r;
}

}  // namespace treemarch
