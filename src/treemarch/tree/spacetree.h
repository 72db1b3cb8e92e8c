/// \file
/// The spacetree (quadtree, octree and their generalisations): a forest of root cells that are refined by a pattern.
/// Source: paper, section "Spacetree generation".
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// The lattice of finest cells. It fills the image's box exactly: extent * unit == size of the image.
template <int Dim>
struct Lattice {
  Coord<Dim> extent{};  ///< finest cells per axis
  Vec<Dim> unit{};      ///< physical sides of a finest cell
};

/// How cells are refined: factors[l][d] is the number of parts into which a cell of level l is split along axis d (>=
/// 1, and > 1 on some axis). Level 0 is the roots, level factors.size() the finest cells.
template <int Dim>
struct RefinementPattern {
  std::vector<Coord<Dim>> factors;

  [[nodiscard]] int finest_level() const { return static_cast<int>(factors.size()); }
  /// Sides of a cell of `level` in finest cells.
  [[nodiscard]] Coord<Dim> cell_extent(int level) const {
    Coord<Dim> e{};
    e.fill(1);
    for (int l = level; l < finest_level(); ++l)
      for (int d = 0; d < Dim; ++d) e[d] *= factors[l][d];
    return e;
  }
};

using LeafId = std::int32_t;
/// What leaf_at() gives beyond the box.
inline constexpr LeafId kNoLeaf = -1;

template <int Dim>
struct Leaf {
  Coord<Dim> corner{};  ///< lower corner, in finest cells
  std::uint8_t level = 0;
  MaterialId material = kOutside;  ///< set by assign_materials() (sizing)
};

/// Leaves in the order of the roots (first axis fastest), within a root in the order of a depth-first walk (first axis
/// fastest among children). All of them lie inside the box; together they fill it.
template <int Dim>
class Spacetree {
 public:
  Lattice<Dim> lattice;
  RefinementPattern<Dim> pattern;
  std::vector<Leaf<Dim>> leaves;

  /// Sides of a leaf in finest cells.
  [[nodiscard]] const Coord<Dim>& extent_of(const Leaf<Dim>& leaf) const { return cell_extent_[leaf.level]; }
  /// The leaf that covers a finest cell, or kNoLeaf beyond the box. Constant time.
  [[nodiscard]] LeafId leaf_at(const Coord<Dim>& cell) const {
    for (int d = 0; d < Dim; ++d)
      if (cell[d] < 0 || cell[d] >= lattice.extent[d]) return kNoLeaf;
    return powers_of_two_ ? leaf_at<true>(cell) : leaf_at<false>(cell);
  }
  [[nodiscard]] const Coord<Dim>& root_extent() const { return root_extent_; }

  /// Fills the lookup of leaf_at() from lattice, pattern and leaves (used by build_spacetree()).
  void index_leaves(const Execution& execution);

 private:
  // Each root has a dense grid of slots as fine as its own finest leaf: lookups without a search, and memory only where
  // the tree is deep.
  struct Root {
    std::int64_t first_slot = 0;
    std::int32_t depth = 0;
  };
  // The lookup, with shifts in place of divisions where every cell's sides are powers of two.
  template <bool Shift>
  [[nodiscard]] LeafId leaf_at(const Coord<Dim>& cell) const {
    std::int64_t root = 0;
    Coord<Dim> local{};
    for (int d = Dim; d-- > 0;) {
      const std::int32_t r = Shift ? cell[d] >> log2_extent_[0][d] : cell[d] / cell_extent_[0][d];
      local[d] = cell[d] - r * cell_extent_[0][d];
      root = root * root_extent_[d] + r;
    }
    const Root& r = roots_[root];
    std::int64_t slot = 0;
    for (int d = Dim; d-- > 0;)
      slot = slot * slots_per_axis_[r.depth][d] +
             (Shift ? local[d] >> log2_extent_[r.depth][d] : local[d] / cell_extent_[r.depth][d]);
    return slots_[r.first_slot + slot];
  }

  Coord<Dim> root_extent_{};
  std::vector<Coord<Dim>> cell_extent_;     // per level
  std::vector<Coord<Dim>> log2_extent_;     // per level, of cell_extent_, rounded down
  std::vector<Coord<Dim>> slots_per_axis_;  // per level
  bool powers_of_two_ = false;
  std::vector<Root> roots_;
  std::vector<LeafId> slots_;
};

/// No limit to the difference of level between neighbours.
inline constexpr int kUnbalanced = 0;

/// Builds the tree top-down.
/// \param required_level one a finest cell of the lattice (first axis fastest): the level at least that the leaf there
/// has. \param balance the difference of level over faces, edges and corners is at most this; kUnbalanced for no limit.
/// \pre required_level.size() equals the product of lattice.extent, every entry <= pattern.finest_level().
/// \throw Error(limits) if there are more than 2^31 - 1 leaves.
/// Cells that straddle the box are split, those beyond it dropped.
template <int Dim>
Spacetree<Dim> build_spacetree(const Lattice<Dim>& lattice, const RefinementPattern<Dim>& pattern,
                               std::span<const std::uint8_t> required_level, int balance, Execution& execution);

/// Whether the levels of leaves that share a point differ by at most `balance`.
template <int Dim>
bool is_balanced(const Spacetree<Dim>& tree, int balance);

}  // namespace treemarch
