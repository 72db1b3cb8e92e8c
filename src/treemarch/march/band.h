/// \file
/// The part of a snapped lattice that an interface has changed, told from the rest.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/march/stencil.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// Leaves are worked on in blocks of so many, wherever the order of their simplices counts.
inline constexpr std::int64_t kLeavesPerBlock = 2048;

/// The simplices of a lattice whose vertices do not all have the same single label. All others, the far ones, lie in
/// one material and have not changed; they are only counted, and listed by for_far() when they are wanted. Those of one
/// material may be left out.
template <int Dim>
class Band {
 public:
  using Simplex = std::array<VertexId, Dim + 1>;
  using Triangle = std::array<VertexId, 3>;  // ascending
  static constexpr std::uint8_t kOneLabel = 0x80;

  /// \param left_out the material whose far simplices do not count, or kOutside
  Band(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, MaterialId left_out, Execution& execution);

  /// They come in blocks, one for each block of leaves, in the order of the leaves.
  [[nodiscard]] std::int64_t blocks() const { return std::ssize(parts_); }
  [[nodiscard]] std::span<const Simplex> simplices(std::int64_t block) const { return parts_[block].simplices; }
  /// Of each simplex of a block: bit e is set where edge e joins vertices without a common label and is cut; or
  /// kOneLabel if all vertices share the label of the first one that has no other.
  [[nodiscard]] std::span<const std::uint8_t> cuts(std::int64_t block) const { return parts_[block].cuts; }
  /// Simplices before a block. \pre 0 <= block <= blocks()
  [[nodiscard]] std::int64_t first(std::int64_t block) const { return first_[block]; }
  [[nodiscard]] std::int64_t size() const { return first_.back(); }
  /// Triangles with three cuts, ascending.
  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] std::int64_t far_count() const { return far_count_; }
  /// Far simplices that are left out.
  [[nodiscard]] std::int64_t left_out_count() const { return left_out_count_; }
  /// Leaves that have some of them.
  [[nodiscard]] const Marks& leaves_left_out() const { return leaves_left_out_; }

  /// Calls visit(number, simplex, material) for each far simplex, from several threads; numbers are 0 to far_count().
  template <class Visit>
  void for_far(const Execution& execution, Visit&& visit) const {
    parallel_for(execution, static_cast<std::int64_t>(first_far_.size()), 1, [&](std::int64_t block) {
      std::int64_t next = first_far_[block];
      sort_block(
          block, [&](std::int64_t leaf) { return leaves_far_[static_cast<std::size_t>(leaf)]; }, [](const Simplex&) {},
          [&](LeafId, const Simplex& simplex, MaterialId material) {
            if (material != left_out_) visit(next++, simplex, material);
          });
    });
  }

 private:
  struct Part {
    std::vector<Simplex> simplices;
    std::vector<std::uint8_t> cuts;
    std::vector<Triangle> triangles;
  };

  void find_cuts(const Simplex& simplex, Part& part) const;
  void list_triangles(Execution& execution);
  /// Calls near(simplex) or far(leaf, simplex, material) for those of a block of leaves for which wanted(leaf) is true.
  template <class Wanted, class Near, class Far>
  void sort_block(std::int64_t block, Wanted&& wanted, Near&& near, Far&& far) const {
    std::array<Simplex, LeafStar<Dim>::kMostSimplices> listed;
    const auto n = static_cast<std::int64_t>(lattice_.leaves.size());
    for (std::int64_t leaf = block * kLeavesPerBlock; leaf < std::min(n, (block + 1) * kLeavesPerBlock); ++leaf) {
      if (!wanted(leaf)) continue;
      const LeafStar<Dim> star = lattice_.star(static_cast<LeafId>(leaf));
      const bool all_far = star.all_of([&](VertexId v) { return labels_.same_single(v, star.centre); });
      const int count = star.simplices(listed);
      for (const Simplex& simplex : std::span(listed).first(count)) {
        bool one = all_far || labels_.single(simplex[0]);
        for (int k = 1; k <= Dim && !all_far; ++k) one &= labels_.same_single(simplex[0], simplex[k]);
        if (one)
          far(static_cast<LeafId>(leaf), simplex, labels_.of(simplex[0])[0]);
        else
          near(simplex);
      }
    }
  }

  const SimplexLattice<Dim>& lattice_;
  const VertexLabels& labels_;
  const MaterialId left_out_;
  std::vector<Part> parts_;          // one a block of leaves
  std::vector<std::int64_t> first_;  // simplices before each of them, and all
  std::vector<Triangle> triangles_;
  std::vector<std::int64_t> first_far_;  // far simplices before each block of leaves
  std::int64_t far_count_ = 0, left_out_count_ = 0;
  Marks leaves_far_, leaves_left_out_;  // that have some of these
};

}  // namespace treemarch
