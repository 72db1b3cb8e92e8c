/// \file
/// The part of a lattice that an interface can change, told from the rest.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/ranked_bits.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// The simplices of a lattice with several labels, or with a vertex that may move: an end of a *separated* edge, one
/// that joins vertices without a common label. All others, the far ones, lie in one material and stay as they are;
/// they are only counted, and listed by for_far() when they are wanted.
template <int Dim>
class Band {
 public:
  using Simplex = std::array<VertexId, Dim + 1>;

  /// \param left_out material whose far simplices are neither counted nor listed, or kOutside.
  /// \throw Error(limits) if the band has 2^32 simplices or more.
  Band(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, MaterialId left_out, Execution& execution);

  /// In the order of the leaves.
  [[nodiscard]] const std::vector<Simplex>& simplices() const { return simplices_; }
  /// The ends of separated edges, numbered.
  [[nodiscard]] const RankedBits& ends() const { return ends_; }
  [[nodiscard]] std::int64_t end_count() const { return end_count_; }
  [[nodiscard]] std::int64_t far_count() const { return far_count_; }
  /// Simplices of the whole lattice.
  [[nodiscard]] std::int64_t lattice_count() const { return lattice_count_; }

  /// Calls visit(number, simplex, material) for each far simplex, from several threads; numbers are 0 to far_count().
  /// \param labels those that the band was made of; sets of ends may have changed since.
  template <class Visit>
  void for_far(const VertexLabels& labels, const Execution& execution, Visit&& visit) const {
    parallel_for(execution, static_cast<std::int64_t>(first_far_.size()), 1, [&](std::int64_t block) {
      std::int64_t next = first_far_[block];
      sort_block(
          labels, block, [](const Simplex&) {},
          [&](const Simplex& simplex, MaterialId material) { visit(next++, simplex, material); });
    });
  }

 private:
  static constexpr std::int64_t kBlock = 2048;  // leaves
  using Listed = std::array<Simplex, LeafStar<Dim>::kMostSimplices>;

  void find_ends(const VertexLabels& labels, Execution& execution);
  void sort_out(const VertexLabels& labels, Execution& execution);
  /// Calls near(simplex) or far(simplex, material) for those of a block of leaves. \return how many there are in all.
  template <class Near, class Far>
  std::int64_t sort_block(const VertexLabels& labels, std::int64_t block, Near&& near, Far&& far) const {
    Listed listed;
    std::int64_t total = 0;
    const auto n = static_cast<std::int64_t>(lattice_.leaves.size());
    for (std::int64_t leaf = block * kBlock; leaf < std::min(n, (block + 1) * kBlock); ++leaf) {
      const LeafStar<Dim> star = lattice_.star(static_cast<LeafId>(leaf));
      const auto is_far = [&](VertexId v) { return labels.same_single(v, star.centre) && !ends_.contains(v); };
      const bool all_far = star.all_of(is_far);
      const MaterialId here = labels.of(star.centre)[0];
      if (all_far && here == left_out_) continue;
      const int count = star.simplices(listed);
      total += count;
      for (const Simplex& simplex : std::span(listed).first(count)) {
        if (all_far) {
          far(simplex, here);
          continue;
        }
        bool one = labels.single(simplex[0]);
        for (const VertexId v : simplex) one &= labels.same_single(v, simplex[0]) && !ends_.contains(v);
        if (!one)
          near(simplex);
        else if (const MaterialId m = labels.of(simplex[0])[0]; m != left_out_)
          far(simplex, m);
      }
    }
    return total;
  }

  const SimplexLattice<Dim>& lattice_;
  MaterialId left_out_;
  RankedBits ends_;
  std::vector<Simplex> simplices_;
  std::vector<std::int64_t> first_far_;  // per block
  std::int64_t end_count_ = 0, far_count_ = 0, lattice_count_ = 0;
};

}  // namespace treemarch
