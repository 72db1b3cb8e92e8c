/// \file
/// The vertices of the body-centred lattice as a set of bits, and their numbers.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/ranked_bits.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Corners and centres of leaves have coordinates, in half sides of a finest cell, that are all even (corners, centres
/// of larger leaves) or all odd (centres of finest cells); only centres of faces of finest cells on the hull (3D) mix
/// both. So two bits a finest cell are enough, where the lattice of all half sides has eight. Numbers are ranks: all
/// even points, all odd ones, then those on the hull, each kind by position, the first axis fastest.
template <int Dim>
class BodyCentredPoints {
 public:
  BodyCentredPoints() = default;
  /// \param cells finest cells along each axis.
  explicit BodyCentredPoints(const Coord<Dim>& cells);

  void insert(const Coord<Dim>& half) { bits_.insert(key(half)); }
  /// The centre and the corners of a finest cell.
  void insert_finest(const Coord<Dim>& cell) {
    bits_.insert(odd_key(cell));
    const std::int64_t corner = even_key(cell);
    for (int c = 0; c < 1 << Dim; c += 2) {
      std::int64_t key = corner;
      for (int d = 1; d < Dim; ++d) key += c >> d & 1 ? even_stride_[d] : 0;
      bits_.insert_two(key);
    }
  }
  [[nodiscard]] bool contains(const Coord<Dim>& half) const { return bits_.contains(key(half)); }
  std::int64_t number(const Execution& execution) { return bits_.number(execution); }
  /// \pre number() was called and the set contains the point.
  [[nodiscard]] VertexId id(const Coord<Dim>& half) const { return bits_.rank(key(half)); }
  /// The same of a point whose coordinates are all even.
  [[nodiscard]] VertexId even_id(const Coord<Dim>& half) const { return bits_.rank(even_key_of(half)); }
  /// Calls visit(v), from several threads, for each even point that is no corner of a finest cell.
  template <class Visit>
  void for_corners_without_finest(const Execution& execution, Visit&& visit) const;
  /// Coordinates of the points in the order of their numbers.
  [[nodiscard]] RawVector<Coord<Dim>> coordinates(std::int64_t size, const Execution& execution) const;

  /// Place in bits() of the even point (2 c) and of the odd one (2 c + 1); neighbours along axis d are stride apart.
  [[nodiscard]] std::int64_t even_key(const Coord<Dim>& c) const { return linear_index(c, even_extent_); }
  /// The same of an even point in half sides.
  [[nodiscard]] std::int64_t even_key_of(const Coord<Dim>& half) const {
    std::int64_t key = 0;
    for (int d = 0; d < Dim; ++d) key += even_stride_[d] * (half[d] >> 1);
    return key;
  }
  [[nodiscard]] std::int64_t odd_key(const Coord<Dim>& c) const { return first_odd_ + linear_index(c, cells_); }
  [[nodiscard]] std::int64_t even_stride(int axis) const { return even_stride_[axis]; }
  [[nodiscard]] std::int64_t odd_stride(int axis) const { return odd_stride_[axis]; }
  [[nodiscard]] const RankedBits& bits() const { return bits_; }
  [[nodiscard]] const Coord<Dim>& cells() const { return cells_; }

 private:
  [[nodiscard]] std::int64_t key(const Coord<Dim>& half) const;
  [[nodiscard]] Coord<Dim> point_of(std::int64_t key) const;

  Coord<Dim> cells_{}, even_extent_{};
  std::array<std::int64_t, Dim> even_stride_{}, odd_stride_{};
  std::int64_t first_odd_ = 0;
  std::array<std::int64_t, 2 * Dim + 1> first_on_side_{};  // 2 axis + up; then the total
  RankedBits bits_;
};

/// By words: a corner of a finest cell has the centre of one before or behind it in one of the rows of odd points
/// around.
template <int Dim>
template <class Visit>
void BodyCentredPoints<Dim>::for_corners_without_finest(const Execution& execution, Visit&& visit) const {
  constexpr std::int64_t kRowsPerTask = 64;
  const auto first_bits = [](std::int64_t n) { return n < 64 ? (std::uint64_t{1} << n) - 1 : ~std::uint64_t{0}; };
  parallel_for(execution, product(even_extent_) / even_extent_[0], kRowsPerTask, [&](std::int64_t row) {
    Coord<Dim> corner = coord_of(row * even_extent_[0], even_extent_);
    for (std::int32_t x = 0; x < even_extent_[0]; x += 64) {
      std::uint64_t beside = 0;
      for (int c = 0; c < 1 << Dim; c += 2) {
        Coord<Dim> cell = corner;
        bool inside = true;
        for (int d = 1; d < Dim; ++d) {
          cell[d] -= c >> d & 1;
          inside &= cell[d] >= 0 && cell[d] < cells_[d];
        }
        if (!inside) continue;
        const std::int64_t odd = odd_key(cell) + x;
        const std::uint64_t behind = bits_.word_from(odd) & first_bits(cells_[0] - x);
        beside |= behind | (behind << 1) | (x > 0 && bits_.contains(odd - 1) ? 1U : 0U);
      }
      const std::int64_t even = row * even_extent_[0] + x;
      const std::uint64_t here = bits_.word_from(even) & first_bits(even_extent_[0] - x);
      for (std::uint64_t rest = here & ~beside; rest != 0; rest &= rest - 1)
        visit(bits_.rank(even + std::countr_zero(rest)));
    }
  });
}

}  // namespace treemarch
