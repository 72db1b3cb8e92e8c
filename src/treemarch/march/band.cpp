#include "treemarch/march/band.h"

#include <algorithm>
#include <limits>

#include "treemarch/core/error.h"

namespace treemarch {

template <int Dim>
Band<Dim>::Band(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, MaterialId left_out,
                Execution& execution)
    : lattice_(lattice), left_out_(left_out), ends_(static_cast<std::int64_t>(lattice.vertices.size())) {
  find_ends(labels, execution);
  sort_out(labels, execution);
}

template <int Dim>
void Band<Dim>::find_ends(const VertexLabels& labels, Execution& execution) {
  parallel_for_ranges(execution, static_cast<std::int64_t>(lattice_.leaves.size()), kBlock,
                      [&](std::int64_t begin, std::int64_t end) {
                        Listed listed;
                        for (std::int64_t leaf = begin; leaf < end; ++leaf) {
                          const LeafStar<Dim> star = lattice_.star(static_cast<LeafId>(leaf));
                          if (star.all_of([&](VertexId v) { return labels.same_single(v, star.centre); })) continue;
                          const int count = star.simplices(listed);
                          for (const Simplex& simplex : std::span(listed).first(count))
                            for (int i = 0; i < Dim; ++i)
                              for (int j = i + 1; j <= Dim; ++j) {
                                if (!labels.disjoint(simplex[i], simplex[j])) continue;
                                ends_.insert(simplex[i]);
                                ends_.insert(simplex[j]);
                              }
                        }
                      });
  end_count_ = ends_.number(execution);
}

template <int Dim>
void Band<Dim>::sort_out(const VertexLabels& labels, Execution& execution) {
  first_far_.resize(block_count(static_cast<std::int64_t>(lattice_.leaves.size()), kBlock));
  const auto blocks = static_cast<std::int64_t>(first_far_.size());
  std::vector<std::vector<Simplex>> part(blocks);
  std::vector<std::int64_t> first(blocks), total(blocks);
  parallel_for_ranges(execution, blocks, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Simplex> found;
    for (std::int64_t b = begin; b < end; ++b) {
      found.clear();
      std::int64_t far = 0;
      total[b] = sort_block(
          labels, b, [&](const Simplex& simplex) { found.push_back(simplex); },
          [&](const Simplex&, MaterialId) { ++far; });
      part[b].assign(found.begin(), found.end());
      first[b] = static_cast<std::int64_t>(found.size());
      first_far_[b] = far;
    }
  });
  for (const std::int64_t t : total) lattice_count_ += t;
  const std::int64_t count = exclusive_scan(std::span(first));
  far_count_ = exclusive_scan(std::span(first_far_));
  if (count >= static_cast<std::int64_t>(std::numeric_limits<std::uint32_t>::max()))
    throw Error(ErrorKind::limits, "--min-size: 2^32 or more lattice simplices near interfaces; choose larger cells");
  simplices_.resize(count);
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::copy(part[b].begin(), part[b].end(), simplices_.begin() + first[b]);
    std::vector<Simplex>().swap(part[b]);
  });
}

template class Band<2>;
template class Band<3>;

}  // namespace treemarch
