/// \file
/// The set of lattice points that are vertices, and their numbers.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/ranked_bits.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// A set of points of the lattice in half units of the finest cell: coordinate c stands for c / 2 cells, so that the
/// centres of cells and of their faces are exact. One bit a point; numbers are ranks, hence sorted by position without
/// a sort or a search.
template <int Dim>
class LatticePoints {
 public:
  explicit LatticePoints(const Lattice<Dim>& lattice) {
    std::int64_t n = 1;
    for (int d = 0; d < Dim; ++d) {
      stride_[d] = n;
      n *= 2 * std::int64_t{lattice.extent[d]} + 1;
    }
    points_ = RankedBits(n);
  }

  /// May be called from several threads at once, together with contains().
  void insert(const Coord<Dim>& half) { points_.insert(key(half)); }
  [[nodiscard]] bool contains(const Coord<Dim>& half) const { return points_.contains(key(half)); }

  /// Numbers the points; call once after the last insert(). Returns how many there are.
  /// \throw Error(limits) with more points than VertexId can count.
  std::int64_t number(const Execution& execution);
  /// \pre number() was called and the set contains the point.
  [[nodiscard]] VertexId id(const Coord<Dim>& half) const { return points_.rank(key(half)); }
  /// Physical positions of the points in the order of their numbers.
  [[nodiscard]] Points<Dim> positions(const Lattice<Dim>& lattice, const Execution& execution) const;

 private:
  [[nodiscard]] std::int64_t key(const Coord<Dim>& half) const {
    std::int64_t k = 0;
    for (int d = 0; d < Dim; ++d) k += stride_[d] * half[d];
    return k;
  }
  std::array<std::int64_t, Dim> stride_{};
  RankedBits points_;
  std::int64_t size_ = 0;
};

}  // namespace treemarch
