#include "treemarch/sizing/grading.h"

#include <algorithm>
#include <cmath>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

using Levels = std::vector<std::uint8_t>;

/// The largest entry among the children of each cell of a coarser grid.
template <int Dim>
Levels coarsened(const Levels& fine, const Coord<Dim>& extent, const Coord<Dim>& factor, Coord<Dim>& cells,
                 const Execution& execution) {
  for (int d = 0; d < Dim; ++d) cells[d] = (extent[d] + factor[d] - 1) / factor[d];
  Levels coarse(static_cast<std::size_t>(product(cells)));
  parallel_for(execution, product(cells), 2048, [&](std::int64_t i) {
    Coord<Dim> first = coord_of(i, cells), count{};
    for (int d = 0; d < Dim; ++d) {
      first[d] *= factor[d];
      count[d] = std::min(factor[d], extent[d] - first[d]);
    }
    for (std::int64_t k = 0; k < product(count); ++k) {
      Coord<Dim> c = coord_of(k, count);
      for (int d = 0; d < Dim; ++d) c[d] += first[d];
      coarse[i] = std::max(coarse[i], fine[linear_index(c, extent)]);
    }
  });
  return coarse;
}

/// The largest entry within `reach` cells along every axis.
template <int Dim>
void dilate(Levels& levels, const Coord<Dim>& cells, int reach, const Execution& execution) {
  for (std::int64_t d = 0, stride = 1; d < Dim; stride *= cells[d++]) {
    const Levels before = levels;
    parallel_for(execution, product(cells), 4096, [&](std::int64_t i) {
      const std::int64_t at = i / stride % cells[d];
      const std::int64_t low = std::max<std::int64_t>(0, at - reach),
                         high = std::min<std::int64_t>(cells[d] - 1, at + reach);
      for (std::int64_t k = low; k <= high; ++k) levels[i] = std::max(levels[i], before[i + (k - at) * stride]);
    });
  }
}

}  // namespace

template <int Dim>
void limit_growth(const SizedLattice<Dim>& sized, double grading, std::vector<std::uint8_t>& levels,
                  const Execution& execution) {
  constexpr double kRounding = 1e-9;
  const int reach = static_cast<int>(std::ceil(1 / grading - kRounding)) - 1;
  if (reach == 0) return;
  // From fine to coarse: what is asked for on the grid of each level, and there the cells that must have it.
  const int finest = sized.pattern.finest_level();
  std::vector<Levels> rooms(static_cast<std::size_t>(finest) + 1);
  std::vector<Coord<Dim>> extents(rooms.size());
  Levels asked = levels;
  extents[finest] = sized.lattice.extent;
  for (int l = finest; l > 0; --l) {
    Levels& room = rooms[l] = asked;
    for (std::uint8_t& r : room) r = r >= l ? static_cast<std::uint8_t>(l) : std::uint8_t{0};
    dilate(room, extents[l], reach, execution);
    for (std::size_t i = 0; i < room.size(); ++i) asked[i] = std::max(asked[i], room[i]);
    asked = coarsened(asked, extents[l], sized.pattern.factors[l - 1], extents[l - 1], execution);
  }
  parallel_for(execution, static_cast<std::int64_t>(levels.size()), 4096, [&](std::int64_t i) {
    Coord<Dim> c = coord_of(i, extents[finest]);
    for (int l = finest; l > 0; --l) {
      levels[i] = std::max(levels[i], rooms[l][linear_index(c, extents[l])]);
      for (int d = 0; d < Dim; ++d) c[d] /= sized.pattern.factors[l - 1][d];
    }
  });
}

#define TREEMARCH_INSTANTIATE(DIM) \
  template void limit_growth(const SizedLattice<DIM>&, double, std::vector<std::uint8_t>&, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
