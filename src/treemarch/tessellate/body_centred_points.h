/// \file
/// The vertices of the body-centred lattice as a set of bits, and their numbers.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/ranked_bits.h"
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
  [[nodiscard]] bool contains(const Coord<Dim>& half) const { return bits_.contains(key(half)); }
  std::int64_t number(const Execution& execution) { return bits_.number(execution); }
  /// \pre number() was called and the set contains the point.
  [[nodiscard]] VertexId id(const Coord<Dim>& half) const { return bits_.rank(key(half)); }
  /// Coordinates of the points in the order of their numbers.
  [[nodiscard]] std::vector<Coord<Dim>> coordinates(std::int64_t size, const Execution& execution) const;

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

}  // namespace treemarch
