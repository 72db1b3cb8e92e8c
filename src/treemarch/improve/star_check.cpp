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

using Lanes [[gnu::vector_size(64)]] = double;

template <int Dim>
[[gnu::always_inline]] inline bool group_meets(const double* group, const Vec<Dim>& x,
                                               const SquaredQualityBound& bound) {
  std::array<std::array<Lanes, Dim>, Dim> edges;
  for (int k = 0; k < Dim; ++k)
    for (int d = 0; d < Dim; ++d) {
      std::memcpy(&edges[k][d], group + (k * Dim + d) * (sizeof(Lanes) / sizeof(double)), sizeof(Lanes));
      edges[k][d] -= x[d];
    }
  const auto meets = detail::edges_meet(edges, bound);
  bool all = true;
  for (std::size_t i = 0; i < sizeof(Lanes) / sizeof(double); ++i) all &= meets[i] != 0;
  return all;
}

TREEMARCH_VECTOR_CLONES
bool one_group_meets(const double* group, const Vec<2>& x, const SquaredQualityBound& bound) {
  return group_meets<2>(group, x, bound);
}
TREEMARCH_VECTOR_CLONES
bool one_group_meets(const double* group, const Vec<3>& x, const SquaredQualityBound& bound) {
  return group_meets<3>(group, x, bound);
}

}  // namespace

template <int Dim>
void StarCheck<Dim>::gather(const Patch<Dim>& patch, VertexId v) {
  const auto star = patch.star(v);
  size_ = (star.size() + kLanes - 1) / kLanes;
  worst_ = 0;
  groups_.resize(size_ * Dim * Dim * kLanes);
  for (std::size_t i = 0; i < size_ * kLanes; ++i) {
    const SimplexVertices<Dim> cell = patch.cell(star[std::min(i, star.size() - 1)]);
    int own = 0;
    while (cell[own] != v) ++own;
    double* const to = groups_.data() + i / kLanes * Dim * Dim * kLanes + i % kLanes;
    for (int k = 0; k < Dim; ++k) {
      const Vec<Dim>& p = patch.point(cell[kOthers<Dim>[own][k]]);
      for (int d = 0; d < Dim; ++d) to[(k * Dim + d) * kLanes] = p[d];
    }
  }
}

template <int Dim>
bool StarCheck<Dim>::all_meet(const Vec<Dim>& x, const SquaredQualityBound& bound) {
  for (std::size_t i = 0; i < size_; ++i) {
    // The one that failed last is likely to do so again.
    const std::size_t group = i == 0 ? worst_ : i <= worst_ ? i - 1 : i;
    if (one_group_meets(groups_.data() + group * Dim * Dim * kLanes, x, bound)) continue;
    worst_ = group;
    return false;
  }
  return true;
}

template class StarCheck<2>;
template class StarCheck<3>;

}  // namespace treemarch
