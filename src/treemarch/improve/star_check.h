/// \file
/// Whether the cells around a vertex are good enough, many cells at once.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/improve/patch.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {

/// The vertices of a cell but one of them, in an order that makes a cell of the same orientation behind that one.
/// \pre v is one of them
template <int Dim>
std::array<VertexId, Dim> others_of(const SimplexVertices<Dim>& cell, VertexId v);

/// The cells around one vertex after another, laid out for vectors. One object a thread: it holds the scratch memory.
template <int Dim>
class StarCheck {
 public:
  /// Takes the cells around a vertex as they are now. \param cells others_of() of each, at least one
  void gather(const Points<Dim>& points, std::span<const std::array<VertexId, Dim>> cells);
  /// Whether all of them reach the bound when the vertex is at x.
  [[nodiscard]] bool all_meet(const Vec<Dim>& x, const SquaredQualityBound& bound);
  /// Calls use(i) for each that does not, in the order they were given.
  template <class Use>
  void visit_failing(const Vec<Dim>& x, const SquaredQualityBound& bound, Use&& use) const {
    for (std::size_t group = 0; group < size_; ++group)
      for (unsigned lanes = failing_lanes(group, x, bound); lanes != 0; lanes &= lanes - 1)
        if (const std::size_t i = group * kLanes + std::countr_zero(lanes); i < cells_) use(i);
  }
  /// The smallest and the largest coordinates of the vertices around it.
  [[nodiscard]] std::pair<Vec<Dim>, Vec<Dim>> bounds() const;

 private:
  static constexpr int kLanes = 4;
  using Group = double[Dim][Dim][kLanes];  // corner but the vertex, axis, cell

  /// Bit i: the i-th cell of a group does not meet.
  [[nodiscard]] unsigned failing_lanes(std::size_t group, const Vec<Dim>& x, const SquaredQualityBound& bound) const;

  std::vector<double> groups_;
  std::size_t cells_ = 0;
  std::size_t size_ = 0;   // in groups
  std::size_t worst_ = 0;  // group that failed last
};

}  // namespace treemarch
