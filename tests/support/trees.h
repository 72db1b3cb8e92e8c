/// \file
/// Small trees of every kind for table-driven tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "treemarch/tree/spacetree.h"

namespace treemarch::testing {

/// One row of a table: factors of each level as text, one digit an axis ("221"; one digit alone is for all axes), the
/// balance and the extent of the lattice.
struct TreeCase {
  std::vector<std::string> pattern;
  int balance = 1;
  std::vector<int> extent;
  unsigned seed = 1;
  double density = 0.03;  ///< fraction of the finest cells that ask for a level of their own
};

inline void PrintTo(const TreeCase& c, std::ostream* out) {
  for (const std::string& p : c.pattern) *out << p << ' ';
  *out << "balance " << c.balance << " extent";
  for (const int e : c.extent) *out << ' ' << e;
  *out << " seed " << c.seed;
}

template <int Dim>
RefinementPattern<Dim> pattern_of(const std::vector<std::string>& levels) {
  RefinementPattern<Dim> pattern;
  for (const std::string& text : levels) {
    Coord<Dim> f{};
    for (int d = 0; d < Dim; ++d) f[d] = text[text.size() == 1 ? 0 : static_cast<std::size_t>(d)] - '0';
    pattern.factors.push_back(f);
  }
  return pattern;
}

template <int Dim>
Lattice<Dim> lattice_of(const std::vector<int>& extent) {
  Lattice<Dim> lattice;
  for (int d = 0; d < Dim; ++d) {
    lattice.extent[d] = extent[extent.size() == 1 ? 0 : static_cast<std::size_t>(d)];
    lattice.unit[d] = 1.0 + 0.25 * d;  // exact in binary, and different along each axis
  }
  return lattice;
}

/// Levels for scattered finest cells; all other cells ask for nothing.
inline std::vector<std::uint8_t> random_levels(std::int64_t n, int finest, unsigned seed, double density) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> level(static_cast<std::size_t>(n), 0);
  for (std::uint8_t& l : level)
    if (random() % 10000 < density * 10000) l = static_cast<std::uint8_t>(random() % (finest + 1));
  return level;
}

template <int Dim>
Spacetree<Dim> tree_of(const TreeCase& c, int threads) {
  Execution execution(threads);
  const auto pattern = pattern_of<Dim>(c.pattern);
  const auto lattice = lattice_of<Dim>(c.extent);
  return build_spacetree<Dim>(lattice, pattern,
                              random_levels(product(lattice.extent), pattern.finest_level(), c.seed, c.density),
                              c.balance, execution);
}

}  // namespace treemarch::testing
