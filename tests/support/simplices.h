/// \file
/// Checks of simplicial meshes in exact arithmetic, for meshes whose vertices lie on a lattice.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "treemarch/mesh/mesh.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch::testing {

/// Determinant by elimination without fractions (Bareiss), exact while the numbers fit.
template <int N>
std::int64_t exact_determinant(std::array<std::array<std::int64_t, N>, N> m) {
  std::int64_t sign = 1;
  std::int64_t previous = 1;
  for (int k = 0; k + 1 < N; ++k) {
    int pivot = k;
    while (pivot < N && m[pivot][k] == 0) ++pivot;
    if (pivot == N) return 0;
    if (pivot != k) {
      std::swap(m[pivot], m[k]);
      sign = -sign;
    }
    for (int i = k + 1; i < N; ++i)
      for (int j = k + 1; j < N; ++j) m[i][j] = (m[i][j] * m[k][k] - m[i][k] * m[k][j]) / previous;
    previous = m[k][k];
  }
  return sign * m[N - 1][N - 1];
}

/// The points as integers, in half units of the finest cell; fails where they are not.
template <int Dim>
std::vector<std::array<std::int64_t, Dim>> half_units(const Mesh<Dim>& mesh, const Lattice<Dim>& lattice) {
  std::vector<std::array<std::int64_t, Dim>> result;
  for (const Vec<Dim>& x : mesh.points) {
    std::array<std::int64_t, Dim> h{};
    for (int d = 0; d < Dim; ++d) {
      h[d] = std::llround(2 * x[d] / lattice.unit[d]);
      EXPECT_EQ(static_cast<double>(h[d]) * lattice.unit[d] / 2, x[d]);
    }
    result.push_back(h);
  }
  return result;
}

/// Every facet belongs to two cells that lie on its two sides, or to one and lies on the hull of the lattice's box; all
/// cells are positive; together they have exactly the volume of the leaves, material by material; points are different
/// from each other, all are used, and are sorted by position.
template <int Dim>
void expect_exact_tessellation(const Mesh<Dim>& mesh, const Spacetree<Dim>& tree) {
  ASSERT_EQ(mesh.blocks.size(), 1U);
  const CellBlock& cells = mesh.blocks[0];
  ASSERT_EQ(cells.type, kSimplex<Dim>);
  ASSERT_EQ(cells.vertices.size(), cells.materials.size() * (Dim + 1));
  const auto x = half_units(mesh, tree.lattice);
  for (std::size_t i = 1; i < x.size(); ++i)
    ASSERT_TRUE(std::lexicographical_compare(x[i - 1].rbegin(), x[i - 1].rend(), x[i].rbegin(), x[i].rend()));

  struct Facet {
    std::array<VertexId, Dim> vertices;
    bool odd;
  };
  std::vector<Facet> facets;
  std::vector<std::int64_t> volume(256, 0);
  std::vector<bool> used(x.size(), false);
  for (std::int64_t c = 0; c < cells.size(); ++c) {
    const VertexId* v = cells.cell(c);
    std::array<std::array<std::int64_t, Dim>, Dim> m{};
    for (int i = 0; i < Dim; ++i)
      for (int d = 0; d < Dim; ++d) m[i][d] = x[v[i + 1]][d] - x[v[0]][d];
    const std::int64_t det = exact_determinant<Dim>(m);
    ASSERT_GT(det, 0);
    volume[cells.materials[c]] += det;
    for (int skip = 0; skip <= Dim; ++skip) {
      Facet f{{}, skip % 2 != 0};
      for (int i = 0, k = 0; i <= Dim; ++i)
        if (i != skip) f.vertices[k++] = v[i];
      for (int i = 0; i < Dim; ++i)  // sort, and count the swaps
        for (int k = i + 1; k < Dim; ++k)
          if (f.vertices[k] < f.vertices[i]) {
            std::swap(f.vertices[k], f.vertices[i]);
            f.odd = !f.odd;
          }
      facets.push_back(f);
      used[v[skip]] = true;
    }
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);

  std::vector<std::int64_t> expected(256, 0);
  std::int64_t scale = 1;  // Dim! simplices of determinant 1 in a unit cube, two units a cell
  for (int d = 1; d <= Dim; ++d) scale *= 2 * d;
  for (const Leaf<Dim>& leaf : tree.leaves) expected[leaf.material] += scale * product(tree.extent_of(leaf));
  EXPECT_EQ(volume, expected);

  std::sort(facets.begin(), facets.end(), [](const Facet& a, const Facet& b) { return a.vertices < b.vertices; });
  for (std::size_t i = 0; i < facets.size();) {
    std::size_t end = i + 1;
    while (end < facets.size() && facets[end].vertices == facets[i].vertices) ++end;
    ASSERT_LE(end - i, 2U);
    if (end - i == 2) {
      ASSERT_NE(facets[i].odd, facets[i + 1].odd);
    } else {
      bool on_hull = false;
      for (int d = 0; d < Dim; ++d)
        for (const std::int64_t side : {std::int64_t{0}, 2 * std::int64_t{tree.lattice.extent[d]}})
          on_hull = on_hull || std::all_of(facets[i].vertices.begin(), facets[i].vertices.end(),
                                           [&](VertexId v) { return x[v][d] == side; });
      ASSERT_TRUE(on_hull);
    }
    i = end;
  }
}

}  // namespace treemarch::testing
