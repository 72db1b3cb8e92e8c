/// \file
/// Whether the cells around a vertex are good enough, many cells at once.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/improve/patch.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {

/// The cells around one vertex after another, laid out for vectors. One object a thread: it holds the scratch memory.
template <int Dim>
class StarCheck {
 public:
  /// Takes the cells around v as they are now. \pre patch.has_star(v)
  void gather(const Patch<Dim>& patch, VertexId v);
  /// Whether all of them reach the bound when the vertex is at x.
  [[nodiscard]] bool all_meet(const Vec<Dim>& x, const SquaredQualityBound& bound);

 private:
  static constexpr int kLanes = 8;
  using Group = double[Dim][Dim][kLanes];  // corner but the vertex, axis, cell

  std::vector<double> groups_;
  std::size_t size_ = 0;   // in groups
  std::size_t worst_ = 0;  // group that failed last
};

}  // namespace treemarch
