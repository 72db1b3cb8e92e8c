#include "treemarch/tree/spacetree.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

/// A byte for each cell of one level that overlaps the box.
template <int Dim>
struct Grid {
  Coord<Dim> extent{};
  std::vector<std::uint8_t> values;
};

std::int32_t ceil_div(std::int32_t a, std::int32_t b) { return (a + b - 1) / b; }

void raise_to(std::uint8_t* to, const std::uint8_t* from, std::int64_t n) {
  for (std::int64_t i = 0; i < n; ++i) to[i] = std::max(to[i], from[i]);
}

/// The largest value of each block of `factor` entries along `axis` and of `halo` more on both of its sides.
template <int Dim>
Grid<Dim> reduce_axis(std::span<const std::uint8_t> in, const Coord<Dim>& extent, int axis, std::int32_t factor,
                      std::int32_t halo, const Execution& execution) {
  Grid<Dim> out{extent, {}};
  out.extent[axis] = ceil_div(extent[axis], factor);
  out.values.assign(static_cast<std::size_t>(product(out.extent)), 0);
  std::int64_t row = 1;
  for (int d = 0; d < axis; ++d) row *= extent[d];
  const std::int64_t n_in = extent[axis];
  const std::int64_t n_out = out.extent[axis];
  const std::int64_t rows = static_cast<std::int64_t>(out.values.size()) / row;
  const std::int64_t grain = std::max<std::int64_t>(1, 65536 / (row * factor));
  parallel_for(execution, rows, grain, [&](std::int64_t r) {
    const std::int64_t i = r % n_out;
    const std::int64_t first = std::max<std::int64_t>(0, i * factor - halo);
    const std::int64_t last = std::min(n_in, (i + 1) * factor + halo);
    const std::uint8_t* from = in.data() + (r / n_out) * n_in * row;
    for (std::int64_t j = first; j < last; ++j) raise_to(out.values.data() + r * row, from + j * row, row);
  });
  return out;
}

/// The largest value of each box of `factors` entries and of `halo` more around it.
template <int Dim>
Grid<Dim> reduce(std::span<const std::uint8_t> in, const Coord<Dim>& extent, const Coord<Dim>& factors,
                 std::int32_t halo, const Execution& execution) {
  Grid<Dim> out = reduce_axis(in, extent, 0, factors[0], halo, execution);
  for (int d = 1; d < Dim; ++d)
    if (factors[d] > 1 || halo > 0) out = reduce_axis<Dim>(out.values, out.extent, d, factors[d], halo, execution);
  return out;
}

/// Cells of a level that are cut by the box's far sides must be split; they are the last ones along an axis.
template <int Dim>
void split_straddling(Grid<Dim>& split, const Coord<Dim>& box, const Coord<Dim>& cell) {
  for (int axis = 0; axis < Dim; ++axis) {
    if (box[axis] % cell[axis] == 0) continue;
    std::int64_t row = 1;
    for (int d = 0; d < axis; ++d) row *= split.extent[d];
    const std::int64_t step = row * split.extent[axis];
    for (auto end = split.values.begin() + step;; end += step) {
      std::fill(end - row, end, std::uint8_t{1});
      if (end == split.values.end()) break;
    }
  }
}

/// For each level but the finest: which cells are split, as the sizes and the box demand.
template <int Dim>
std::vector<Grid<Dim>> required_splits(const Lattice<Dim>& lattice, const RefinementPattern<Dim>& pattern,
                                       std::span<const std::uint8_t> required_level, const Execution& execution) {
  std::vector<Grid<Dim>> split(static_cast<std::size_t>(pattern.finest_level()));
  Grid<Dim> peak{lattice.extent, {}};
  std::span<const std::uint8_t> finer = required_level;
  for (int l = pattern.finest_level(); l-- > 0;) {
    peak = reduce<Dim>(finer, peak.extent, pattern.factors[l], 0, execution);
    finer = peak.values;
    split[l] = peak;
    for (std::uint8_t& s : split[l].values) s = s > l ? 1 : 0;
    split_straddling(split[l], lattice.extent, pattern.cell_extent(l));
  }
  return split;
}

/// Adds what balance demands. A split cell of level l has leaves of at least level l + 1 at each of its boundary
/// points, so every cell of level l - balance that touches it must be split too. From fine to coarse each level is
/// complete when it is its turn, hence one pass.
template <int Dim>
void balance_splits(std::vector<Grid<Dim>>& split, const RefinementPattern<Dim>& pattern, int balance,
                    const Execution& execution) {
  for (int l = pattern.finest_level() - 1; l > 0; --l) {
    const auto add = [&](int level, std::int32_t halo) {
      Coord<Dim> factors{};
      factors.fill(1);
      for (int k = level; k < l; ++k)
        for (int d = 0; d < Dim; ++d) factors[d] *= pattern.factors[k][d];
      const Grid<Dim> demand = reduce<Dim>(split[l].values, split[l].extent, factors, halo, execution);
      raise_to(split[level].values.data(), demand.values.data(), static_cast<std::int64_t>(demand.values.size()));
    };
    if (balance > 1) add(l - 1, 0);  // parents; with balance 1 the next line covers them
    if (l >= balance) add(l - balance, 1);
  }
}

/// Calls visit(position) for the positions of a box of `extent`, first axis fastest.
template <int Dim, class Visit>
void for_each_position(const Coord<Dim>& extent, Visit&& visit) {
  Coord<Dim> c{};
  while (true) {
    visit(c);
    int d = 0;
    while (d < Dim && ++c[d] == extent[d]) c[d++] = 0;
    if (d == Dim) return;
  }
}

/// Calls visit(cell, level) for the leaves below a cell, depth first.
template <int Dim, class Visit>
void walk(const std::vector<Grid<Dim>>& split, const RefinementPattern<Dim>& pattern, const Coord<Dim>& box,
          const Coord<Dim>& cell, int level, Visit&& visit) {
  const auto l = static_cast<std::size_t>(level);
  if (l == split.size() || split[l].values[linear_index(cell, split[l].extent)] == 0) {
    visit(cell, level);
    return;
  }
  const Coord<Dim>& limit = l + 1 == split.size() ? box : split[l + 1].extent;
  const Coord<Dim>& factors = pattern.factors[l];
  for_each_position(factors, [&](const Coord<Dim>& offset) {
    Coord<Dim> child{};
    for (int d = 0; d < Dim; ++d) {
      child[d] = cell[d] * factors[d] + offset[d];
      if (child[d] >= limit[d]) return;
    }
    walk(split, pattern, box, child, level + 1, visit);
  });
}

template <int Dim>
std::vector<Leaf<Dim>> collect_leaves(const std::vector<Grid<Dim>>& split, const RefinementPattern<Dim>& pattern,
                                      const Coord<Dim>& box, const Coord<Dim>& root_extent,
                                      const Execution& execution) {
  const std::int64_t roots = product(root_extent);
  std::vector<std::int64_t> first(static_cast<std::size_t>(roots));
  parallel_for(execution, roots, 16, [&](std::int64_t r) {
    std::int64_t n = 0;
    walk(split, pattern, box, coord_of(r, root_extent), 0, [&](const Coord<Dim>&, int) { ++n; });
    first[r] = n;
  });
  const std::int64_t total = exclusive_scan(std::span(first));
  if (total > std::numeric_limits<LeafId>::max())
    throw Error(ErrorKind::limits, "--min-size: the tree would have " + std::to_string(total) +
                                       " leaves, more than 2147483647; choose a larger size");
  std::vector<Coord<Dim>> side;
  for (int l = 0; l <= pattern.finest_level(); ++l) side.push_back(pattern.cell_extent(l));
  std::vector<Leaf<Dim>> leaves(static_cast<std::size_t>(total));
  parallel_for(execution, roots, 16, [&](std::int64_t r) {
    Leaf<Dim>* out = leaves.data() + first[r];
    walk(split, pattern, box, coord_of(r, root_extent), 0, [&](Coord<Dim> corner, int level) {
      for (int d = 0; d < Dim; ++d) corner[d] *= side[level][d];
      *out++ = {corner, static_cast<std::uint8_t>(level), kOutside};
    });
  });
  return leaves;
}

}  // namespace

template <int Dim>
void Spacetree<Dim>::index_leaves(const Execution& execution) {
  const int levels = pattern.finest_level() + 1;
  cell_extent_.clear();
  log2_extent_.clear();
  slots_per_axis_.clear();
  powers_of_two_ = true;
  for (int l = 0; l < levels; ++l) {
    cell_extent_.push_back(pattern.cell_extent(l));
    log2_extent_.emplace_back();
    for (int d = 0; d < Dim; ++d) {
      const auto side = static_cast<std::uint32_t>(cell_extent_[l][d]);
      log2_extent_[l][d] = std::bit_width(side) - 1;
      powers_of_two_ &= std::has_single_bit(side);
    }
  }
  for (int l = 0; l < levels; ++l) {
    Coord<Dim> n{};
    for (int d = 0; d < Dim; ++d) n[d] = cell_extent_[0][d] / cell_extent_[l][d];
    slots_per_axis_.push_back(n);
  }
  for (int d = 0; d < Dim; ++d) root_extent_[d] = ceil_div(lattice.extent[d], cell_extent_[0][d]);

  const std::int64_t roots = product(root_extent_);
  roots_.assign(static_cast<std::size_t>(roots), {});
  std::vector<std::int64_t> first_leaf(static_cast<std::size_t>(roots) + 1, 0);
  for (const Leaf<Dim>& leaf : leaves) {
    Coord<Dim> r{};
    for (int d = 0; d < Dim; ++d) r[d] = leaf.corner[d] / cell_extent_[0][d];
    const std::int64_t i = linear_index(r, root_extent_);
    ++first_leaf[i];
    roots_[i].depth = std::max<std::int32_t>(roots_[i].depth, leaf.level);
  }
  exclusive_scan(std::span(first_leaf));
  std::int64_t slots = 0;
  for (Root& r : roots_) {
    r.first_slot = slots;
    slots += product(slots_per_axis_[r.depth]);
  }
  slots_.assign(static_cast<std::size_t>(slots), kNoLeaf);
  parallel_for(execution, roots, 16, [&](std::int64_t r) {
    const Root& root = roots_[r];
    const Coord<Dim>& unit = cell_extent_[root.depth];
    for (std::int64_t i = first_leaf[r]; i < first_leaf[r + 1]; ++i) {
      Coord<Dim> low{};
      Coord<Dim> n{};
      for (int d = 0; d < Dim; ++d) {
        low[d] = leaves[i].corner[d] % cell_extent_[0][d] / unit[d];
        n[d] = cell_extent_[leaves[i].level][d] / unit[d];
      }
      for_each_position(n, [&](Coord<Dim> slot) {
        for (int d = 0; d < Dim; ++d) slot[d] += low[d];
        slots_[root.first_slot + linear_index(slot, slots_per_axis_[root.depth])] = static_cast<LeafId>(i);
      });
    }
  });
}

template <int Dim>
Spacetree<Dim> build_spacetree(const Lattice<Dim>& lattice, const RefinementPattern<Dim>& pattern,
                               std::span<const std::uint8_t> required_level, int balance, Execution& execution) {
  Spacetree<Dim> tree;
  tree.lattice = lattice;
  tree.pattern = pattern;
  std::vector<Grid<Dim>> split = required_splits(lattice, pattern, required_level, execution);
  if (balance != kUnbalanced) balance_splits(split, pattern, balance, execution);
  Coord<Dim> root_extent = lattice.extent;
  const Coord<Dim> root = pattern.cell_extent(0);
  for (int d = 0; d < Dim; ++d) root_extent[d] = ceil_div(lattice.extent[d], root[d]);
  tree.leaves = collect_leaves(split, pattern, lattice.extent, root_extent, execution);
  split.clear();
  split.shrink_to_fit();
  tree.index_leaves(execution);
  return tree;
}

template <int Dim>
bool is_balanced(const Spacetree<Dim>& tree, int balance) {
  // It is enough to look from the finer of two leaves: the coarser one covers all of the finer one's side that it
  // touches, so one probe in each of the 3^Dim - 1 directions finds it.
  Coord<Dim> three{};
  three.fill(3);
  for (const Leaf<Dim>& leaf : tree.leaves) {
    bool good = true;
    for_each_position(three, [&](Coord<Dim> probe) {
      for (int d = 0; d < Dim; ++d)
        probe[d] = probe[d] == 0   ? leaf.corner[d] - 1
                   : probe[d] == 1 ? leaf.corner[d]
                                   : leaf.corner[d] + tree.extent_of(leaf)[d];
      const LeafId other = tree.leaf_at(probe);
      if (other != kNoLeaf && leaf.level - tree.leaves[other].level > balance) good = false;
    });
    if (!good) return false;
  }
  return true;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                            \
  template class Spacetree<DIM>;                                                              \
  template Spacetree<DIM> build_spacetree(const Lattice<DIM>&, const RefinementPattern<DIM>&, \
                                          std::span<const std::uint8_t>, int, Execution&);    \
  template bool is_balanced(const Spacetree<DIM>&, int);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
