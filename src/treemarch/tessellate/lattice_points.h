/// \file
/// The set of lattice points that are vertices, and their numbers.
#pragma once

#include <atomic>
#include <bit>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
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
    words_.assign(static_cast<std::size_t>((n + 63) / 64), 0);
  }

  /// May be called from several threads at once, together with contains().
  void insert(const Coord<Dim>& half) {
    const std::int64_t k = key(half);
    std::atomic_ref<std::uint64_t> word(words_[static_cast<std::size_t>(k >> 6)]);
    const std::uint64_t bit = std::uint64_t{1} << (k & 63);
    if ((word.load(std::memory_order_relaxed) & bit) == 0) word.fetch_or(bit, std::memory_order_relaxed);
  }
  [[nodiscard]] bool contains(const Coord<Dim>& half) {
    const std::int64_t k = key(half);
    const std::atomic_ref<std::uint64_t> word(words_[static_cast<std::size_t>(k >> 6)]);
    return (word.load(std::memory_order_relaxed) >> (k & 63) & 1) != 0;
  }

  /// Numbers the points; call once after the last insert(). Returns how many there are.
  /// \throw Error(limits) with more points than VertexId can count.
  std::int64_t number(const Execution& execution);
  /// \pre number() was called and the set contains the point.
  [[nodiscard]] VertexId id(const Coord<Dim>& half) const {
    const std::int64_t k = key(half);
    const auto w = static_cast<std::size_t>(k >> 6);
    const std::uint64_t below = words_[w] & ((std::uint64_t{1} << (k & 63)) - 1);
    return first_[w] + static_cast<VertexId>(std::popcount(below));
  }
  /// Physical positions of the points in the order of their numbers.
  [[nodiscard]] std::vector<Vec<Dim>> positions(const Lattice<Dim>& lattice, const Execution& execution) const;

 private:
  [[nodiscard]] std::int64_t key(const Coord<Dim>& half) const {
    std::int64_t k = 0;
    for (int d = 0; d < Dim; ++d) k += stride_[d] * half[d];
    return k;
  }
  std::array<std::int64_t, Dim> stride_{};
  std::vector<std::uint64_t> words_;
  std::vector<VertexId> first_;  // number of the first point of each word
};

}  // namespace treemarch
