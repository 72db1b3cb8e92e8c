#include "treemarch/improve/star_check.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "treemarch/core/vector_clones.h"

namespace treemarch {
namespace {

/// The same corners with the first one at the given place, in an order of the same orientation.
template <int Dim>
constexpr std::array<std::array<int, Dim>, Dim + 1> kOthers = [] {
  if constexpr (Dim == 2)
    return std::array<std::array<int, 2>, 3>{{{1, 2}, {2, 0}, {0, 1}}};
  else
    return std::array<std::array<int, 3>, 4>{{{1, 2, 3}, {0, 3, 2}, {3, 0, 1}, {2, 1, 0}}};
}();

using Lanes [[gnu::vector_size(32)]] = double;

/// Bit i: the i-th cell does not meet.
template <int Dim>
[[gnu::always_inline]] inline unsigned find_failing(const double* group, const Vec<Dim>& x,
                                                    const SquaredQualityBound& bound) {
  std::array<std::array<Lanes, Dim>, Dim> edges;
  for (int k = 0; k < Dim; ++k)
    for (int d = 0; d < Dim; ++d) {
      std::memcpy(&edges[k][d], group + (k * Dim + d) * (sizeof(Lanes) / sizeof(double)), sizeof(Lanes));
      edges[k][d] -= x[d];
    }
  const auto meets = detail::edges_meet(edges, bound);
  unsigned failing = 0;
  for (std::size_t i = 0; i < sizeof(Lanes) / sizeof(double); ++i) failing |= unsigned{meets[i] == 0} << i;
  return failing;
}

TREEMARCH_VECTOR_CLONES
unsigned failing_of(const double* group, const Vec<2>& x, const SquaredQualityBound& bound) {
  return find_failing<2>(group, x, bound);
}
TREEMARCH_VECTOR_CLONES
unsigned failing_of(const double* group, const Vec<3>& x, const SquaredQualityBound& bound) {
  return find_failing<3>(group, x, bound);
}

/// By lanes.
template <int Dim>
[[gnu::always_inline]] inline void find_bounds(const double* group, std::size_t groups, std::array<Lanes, Dim>& low,
                                               std::array<Lanes, Dim>& high) {
  constexpr std::size_t kLanes = sizeof(Lanes) / sizeof(double);
  for (int d = 0; d < Dim; ++d) std::memcpy(&low[d], group + d * kLanes, sizeof(Lanes));
  high = low;
  for (std::size_t i = 0; i < groups * Dim; ++i)
    for (int d = 0; d < Dim; ++d, group += kLanes) {
      Lanes x;
      std::memcpy(&x, group, sizeof(Lanes));
      low[d] = x < low[d] ? x : low[d];
      high[d] = x > high[d] ? x : high[d];
    }
}

template <int Dim>
[[gnu::always_inline]] inline void find_bounds(const double* group, std::size_t groups,
                                               std::pair<Vec<Dim>, Vec<Dim>>& bounds) {
  std::array<Lanes, Dim> low, high;
  find_bounds<Dim>(group, groups, low, high);
  for (int d = 0; d < Dim; ++d) {
    bounds.first[d] = low[d][0];
    bounds.second[d] = high[d][0];
    for (std::size_t i = 1; i < sizeof(Lanes) / sizeof(double); ++i) {
      bounds.first[d] = std::min<double>(bounds.first[d], low[d][i]);
      bounds.second[d] = std::max<double>(bounds.second[d], high[d][i]);
    }
  }
}

TREEMARCH_VECTOR_CLONES
void bounds_of(const double* group, std::size_t groups, std::pair<Vec<2>, Vec<2>>& bounds) {
  find_bounds<2>(group, groups, bounds);
}
TREEMARCH_VECTOR_CLONES
void bounds_of(const double* group, std::size_t groups, std::pair<Vec<3>, Vec<3>>& bounds) {
  find_bounds<3>(group, groups, bounds);
}

}  // namespace

template <int Dim>
std::array<VertexId, Dim> others_of(const SimplexVertices<Dim>& cell, VertexId v) {
  int own = 0;
  while (cell[own] != v) ++own;
  std::array<VertexId, Dim> others;
  for (int k = 0; k < Dim; ++k) others[k] = cell[kOthers<Dim>[own][k]];
  return others;
}

template <int Dim>
void StarCheck<Dim>::gather(const Points<Dim>& points, std::span<const std::array<VertexId, Dim>> cells) {
  cells_ = cells.size();
  size_ = (cells.size() + kLanes - 1) / kLanes;
  worst_ = 0;
  groups_.resize(size_ * Dim * Dim * kLanes);
  for (std::size_t i = 0; i < size_ * kLanes; ++i) {
    const std::array<VertexId, Dim>& cell = cells[std::min(i, cells.size() - 1)];
    double* const to = groups_.data() + i / kLanes * Dim * Dim * kLanes + i % kLanes;
    for (int k = 0; k < Dim; ++k)
      for (int d = 0; d < Dim; ++d) to[(k * Dim + d) * kLanes] = points[cell[k]][d];
  }
}

template <int Dim>
unsigned StarCheck<Dim>::failing_lanes(std::size_t group, const Vec<Dim>& x, const SquaredQualityBound& bound) const {
  return failing_of(groups_.data() + group * Dim * Dim * kLanes, x, bound);
}

template <int Dim>
bool StarCheck<Dim>::all_meet(const Vec<Dim>& x, const SquaredQualityBound& bound) {
  for (std::size_t i = 0; i < size_; ++i) {
    // The one that failed last is likely to do so again.
    const std::size_t group = i == 0 ? worst_ : i <= worst_ ? i - 1 : i;
    if (failing_lanes(group, x, bound) == 0) continue;
    worst_ = group;
    return false;
  }
  return true;
}

template <int Dim>
std::pair<Vec<Dim>, Vec<Dim>> StarCheck<Dim>::bounds() const {
  std::pair<Vec<Dim>, Vec<Dim>> bounds;
  bounds_of(groups_.data(), size_, bounds);
  return bounds;
}

template std::array<VertexId, 2> others_of<2>(const SimplexVertices<2>&, VertexId);
template std::array<VertexId, 3> others_of<3>(const SimplexVertices<3>&, VertexId);
template class StarCheck<2>;
template class StarCheck<3>;

}  // namespace treemarch
