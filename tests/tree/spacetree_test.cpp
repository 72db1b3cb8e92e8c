#include "treemarch/tree/spacetree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <tuple>

#include "support/trees.h"

namespace treemarch {
namespace {

using testing::TreeCase;

template <int Dim>
using Box = std::tuple<std::array<std::int32_t, Dim>, int>;  // corner and level

/// The smallest tree that meets all demands, by splitting leaves one after the other until none is left to split.
template <int Dim>
std::set<Box<Dim>> brute_force(const Lattice<Dim>& lattice, const RefinementPattern<Dim>& pattern,
                               const std::vector<std::uint8_t>& required, int balance) {
  std::vector<Leaf<Dim>> open;
  std::vector<Leaf<Dim>> leaves;
  const auto extent = [&](const Leaf<Dim>& leaf) { return pattern.cell_extent(leaf.level); };
  const auto add_children = [&](const Coord<Dim>& corner, const Coord<Dim>& count, int level) {
    const Coord<Dim> side = pattern.cell_extent(level);
    for (std::int64_t i = 0; i < product(count); ++i) {
      Coord<Dim> c = coord_of(i, count);
      bool beyond = false;
      for (int d = 0; d < Dim; ++d) {
        c[d] = corner[d] + c[d] * side[d];
        beyond = beyond || c[d] >= lattice.extent[d];
      }
      if (!beyond) leaves.push_back({c, static_cast<std::uint8_t>(level), kOutside});
    }
  };
  const auto must_split = [&](const Leaf<Dim>& leaf) {
    const Coord<Dim> side = extent(leaf);
    for (int d = 0; d < Dim; ++d)
      if (leaf.corner[d] + side[d] > lattice.extent[d]) return true;
    for (std::int64_t i = 0; i < product(side); ++i) {
      Coord<Dim> c = coord_of(i, side);
      for (int d = 0; d < Dim; ++d) c[d] += leaf.corner[d];
      if (required[linear_index(c, lattice.extent)] > leaf.level) return true;
    }
    if (balance == kUnbalanced) return false;
    for (const Leaf<Dim>& other : leaves) {
      bool touch = other.level - leaf.level > balance;
      for (int d = 0; d < Dim && touch; ++d)
        touch = other.corner[d] <= leaf.corner[d] + side[d] && leaf.corner[d] <= other.corner[d] + extent(other)[d];
      if (touch) return true;
    }
    return false;
  };
  Coord<Dim> roots{};
  for (int d = 0; d < Dim; ++d)
    roots[d] = (lattice.extent[d] + pattern.cell_extent(0)[d] - 1) / pattern.cell_extent(0)[d];
  add_children({}, roots, 0);
  bool changed = true;
  while (changed) {
    changed = false;
    for (std::size_t i = 0; i < leaves.size();) {
      if (!must_split(leaves[i])) {
        ++i;
        continue;
      }
      const Leaf<Dim> leaf = leaves[i];
      leaves[i] = leaves.back();
      leaves.pop_back();
      add_children(leaf.corner, pattern.factors[leaf.level], leaf.level + 1);
      changed = true;
    }
  }
  std::set<Box<Dim>> result;
  for (const Leaf<Dim>& leaf : leaves) result.insert({leaf.corner, leaf.level});
  return result;
}

template <int Dim>
void check_order(const Spacetree<Dim>& tree) {
  // Depth first: compare the digits of two successive leaves from the coarsest level on, last axis first.
  const auto key = [&](const Leaf<Dim>& leaf) {
    std::vector<std::int32_t> digits;
    for (int l = 0; l <= tree.pattern.finest_level(); ++l)
      for (int d = Dim; d-- > 0;) digits.push_back(leaf.corner[d] / tree.pattern.cell_extent(l)[d]);
    return digits;
  };
  for (std::size_t i = 1; i < tree.leaves.size(); ++i) ASSERT_LT(key(tree.leaves[i - 1]), key(tree.leaves[i]));
}

template <int Dim>
void check_case(const TreeCase& c) {
  SCOPED_TRACE(::testing::PrintToString(c));
  const Spacetree<Dim> tree = testing::tree_of<Dim>(c, 1);
  const auto required =
      testing::random_levels(product(tree.lattice.extent), tree.pattern.finest_level(), c.seed, c.density);
  std::set<Box<Dim>> found;
  for (const Leaf<Dim>& leaf : tree.leaves) found.insert({leaf.corner, leaf.level});
  EXPECT_EQ(found.size(), tree.leaves.size());
  EXPECT_EQ(found, brute_force(tree.lattice, tree.pattern, required, c.balance));
  check_order(tree);
  EXPECT_TRUE(c.balance == kUnbalanced || is_balanced(tree, c.balance));

  // Each leaf is found from each of its cells, so that the leaves are disjoint and fill the box.
  std::int64_t covered = 0;
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) {
    const Coord<Dim>& side = tree.extent_of(tree.leaves[i]);
    for (std::int64_t k = 0; k < product(side); ++k, ++covered) {
      Coord<Dim> cell = coord_of(k, side);
      for (int d = 0; d < Dim; ++d) cell[d] += tree.leaves[i].corner[d];
      ASSERT_EQ(tree.leaf_at(cell), static_cast<LeafId>(i));
    }
  }
  EXPECT_EQ(covered, product(tree.lattice.extent));
  for (int d = 0; d < Dim; ++d) {
    Coord<Dim> beyond{};
    beyond[d] = -1;
    EXPECT_EQ(tree.leaf_at(beyond), kNoLeaf);
    beyond[d] = tree.lattice.extent[d];
    EXPECT_EQ(tree.leaf_at(beyond), kNoLeaf);
  }

  const Spacetree<Dim> again = testing::tree_of<Dim>(c, 4);
  ASSERT_EQ(again.leaves.size(), tree.leaves.size());
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) {
    ASSERT_EQ(again.leaves[i].corner, tree.leaves[i].corner);
    ASSERT_EQ(again.leaves[i].level, tree.leaves[i].level);
  }
}

/// Every pattern with every balance, on extents that are and are not multiples of the roots.
template <int Dim>
void check_table(const std::vector<std::vector<std::string>>& patterns, const std::vector<std::vector<int>>& extents,
                 const std::vector<double>& densities) {
  for (const auto& pattern : patterns)
    for (const auto& extent : extents)
      for (const double density : densities)
        for (const int balance : {kUnbalanced, 1, 2, 3}) check_case<Dim>({pattern, balance, extent, 7, density});
}

TEST(Spacetree, EqualsBruteForce1D) {
  check_table<1>({{}, {"2"}, {"2", "2", "2", "2", "2"}, {"3", "3", "3"}, {"5", "2", "3"}}, {{32}, {81}, {1}, {50}},
                 {0, 0.05});
}

TEST(Spacetree, EqualsBruteForce2D) {
  check_table<2>({{"2", "2", "2", "2"}, {"3", "3", "3"}, {"21", "21", "2", "2"}, {"32", "2", "13", "2"}},
                 {{32, 16}, {27, 27}, {23, 9}}, {0, 0.01});
}

TEST(Spacetree, EqualsBruteForce3D) {
  check_table<3>({{"2", "2", "2"}, {"3", "3"}, {"221", "221", "2"}, {"3", "2", "221"}},
                 {{16, 8, 8}, {9, 18, 9}, {13, 6, 7}}, {0, 0.01});
}

TEST(Spacetree, EqualsBruteForce4D) {
  check_table<4>({{"2", "2"}, {"3"}, {"2211", "2", "1112"}}, {{8, 4, 4, 4}, {6, 5, 3, 3}}, {0, 0.02});
}

TEST(Spacetree, BalanceIsSeenAtCorners) {
  // One deep corner in the middle of a 2D forest of two by two roots: without balance the root across the corner stays
  // whole, which faces alone would not show.
  const auto pattern = testing::pattern_of<2>({"2", "2", "2"});
  Lattice<2> lattice{{16, 16}, {1, 1}};
  std::vector<std::uint8_t> required(256, 0);
  required[7 + 16 * 7] = 3;
  Execution execution(1);
  for (const int y : {7, 8})
    for (const int x : {7, 8})
      if (x != y) required[x + 16 * y] = 3;
  const auto loose = build_spacetree<2>(lattice, pattern, required, kUnbalanced, execution);
  EXPECT_EQ(loose.leaves[loose.leaf_at({8, 8})].level, 0);
  EXPECT_FALSE(is_balanced(loose, 1));
  EXPECT_FALSE(is_balanced(loose, 2));
  EXPECT_TRUE(is_balanced(loose, 3));
  const auto tight = build_spacetree<2>(lattice, pattern, required, 1, execution);
  EXPECT_EQ(tight.leaves[tight.leaf_at({8, 8})].level, 2);
}

}  // namespace
}  // namespace treemarch
