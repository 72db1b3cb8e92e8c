#include "treemarch/march/edge_table.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/raw_vector.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 2048;  // leaves
constexpr std::int64_t kGrain = 4096;

/// Of vertices or of ends, the lower one first.
using Pair = std::pair<std::uint32_t, std::uint32_t>;

EdgeId scan_counts(std::vector<EdgeId>& counts) {
  std::uint64_t sum = 0;
  for (EdgeId& c : counts) {
    const EdgeId n = c;
    c = static_cast<EdgeId>(sum);
    sum += n;
  }
  if (sum >= kNoEdge)
    throw Error(ErrorKind::limits, "--min-size: more than 2^32 lattice edges cross interfaces; choose larger cells");
  return static_cast<EdgeId>(sum);
}

template <int Dim>
class Finder {
 public:
  using Simplex = typename LeafStar<Dim>::Simplex;

  Finder(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, Execution& execution)
      : lattice_(lattice),
        labels_(labels),
        execution_(execution),
        in_uniform_(static_cast<std::int64_t>(labels.size())),
        blocks_(block_count(static_cast<std::int64_t>(lattice.leaves.size()), kBlock)),
        mixed_leaves_(blocks_),
        pairs_(blocks_) {
    table_.ends = RankedBits(static_cast<std::int64_t>(labels.size()));
  }

  EdgeTable run() {
    find_pairs();
    list_ends();
    find_thin();
    sort_pairs();
    index_upward();
    return std::move(table_);
  }

 private:
  [[nodiscard]] bool in_one_material(const Simplex& simplex) const {
    bool one = labels_.single(simplex[0]);
    for (int k = 1; k <= Dim; ++k) one &= labels_.same_single(simplex[0], simplex[k]);
    return one;
  }
  [[nodiscard]] bool is_thin(VertexId v) const {
    return labels_.single(v) && table_.ends.contains(v) && !in_uniform_.contains(v);
  }
  void find_pairs();
  void list_ends();
  void find_thin();
  void sort_pairs();
  void index_upward();

  const SimplexLattice<Dim>& lattice_;
  const VertexLabels& labels_;
  Execution& execution_;
  RankedBits in_uniform_;  // vertices of simplices with one label only
  std::int64_t blocks_;
  std::vector<std::vector<LeafId>> mixed_leaves_;  // with several labels, per block
  std::vector<std::vector<Pair>> pairs_;           // separated, per block; some repeat
  EdgeTable table_;
};

template <int Dim>
void Finder<Dim>::find_pairs() {
  const auto n = static_cast<std::int64_t>(lattice_.leaves.size());
  parallel_for_ranges(execution_, blocks_, 1, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Pair> found;
    std::array<Simplex, LeafStar<Dim>::kMostSimplices> listed;
    for (std::int64_t b = begin; b < end; ++b) {
      found.clear();
      for (auto leaf = static_cast<LeafId>(b * kBlock); leaf < std::min(n, (b + 1) * kBlock); ++leaf) {
        const LeafStar<Dim> star = lattice_.star(leaf);
        if (star.all_of([&](VertexId v) { return labels_.same_single(v, star.centre); })) {
          star.for_vertices([&](VertexId v) { in_uniform_.insert(v); });
          continue;
        }
        mixed_leaves_[b].push_back(leaf);
        star.for_edges([&](VertexId u, VertexId v) {
          if (!labels_.disjoint(u, v)) return;
          found.emplace_back(std::min(u, v), std::max(u, v));
          table_.ends.insert(u);
          table_.ends.insert(v);
        });
        const int count = star.simplices(listed);
        for (int i = 0; i < count; ++i)
          if (in_one_material(listed[i]))
            for (const VertexId v : listed[i]) in_uniform_.insert(v);
      }
      pairs_[b].assign(found.begin(), found.end());
    }
  });
}

template <int Dim>
void Finder<Dim>::list_ends() {
  const std::int64_t count = table_.ends.number(execution_);
  table_.vertex.resize(count);
  table_.supported.resize(count);
  const auto& words = table_.ends.words();
  parallel_for(execution_, static_cast<std::int64_t>(words.size()), kGrain, [&](std::int64_t w) {
    EndId next = table_.ends.first_of_word(static_cast<std::size_t>(w));
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1) {
      const std::int64_t v = w * 64 + std::countr_zero(rest);
      table_.vertex[next] = static_cast<VertexId>(v);
      table_.supported[next++] = in_uniform_.contains(v);
    }
  });
}

template <int Dim>
void Finder<Dim>::find_thin() {
  std::vector<std::vector<VertexId>> found(blocks_);
  parallel_for(execution_, blocks_, 1, [&](std::int64_t b) {
    std::array<Simplex, LeafStar<Dim>::kMostSimplices> listed;
    for (const LeafId leaf : mixed_leaves_[b]) {
      const LeafStar<Dim> star = lattice_.star(leaf);
      if (star.all_of([&](VertexId v) { return !is_thin(v); })) continue;
      const int count = star.simplices(listed);
      for (int i = 0; i < count; ++i)
        if (std::ranges::any_of(listed[i], [&](VertexId v) { return is_thin(v); }))
          found[b].insert(found[b].end(), listed[i].begin(), listed[i].end());
    }
    std::vector<LeafId>().swap(mixed_leaves_[b]);
  });
  for (const auto& some : found) table_.thin.insert(table_.thin.end(), some.begin(), some.end());
}

/// By their lower ends, then by their upper ones, without repeats.
template <int Dim>
void Finder<Dim>::sort_pairs() {
  const auto ends = static_cast<std::int64_t>(table_.vertex.size());
  std::vector<EdgeId> start(ends + 1, 0);
  parallel_for(execution_, blocks_, 1, [&](std::int64_t b) {
    for (Pair& p : pairs_[b]) {
      p = {table_.end_of(p.first), table_.end_of(p.second)};
      std::atomic_ref(start[p.first]).fetch_add(1, std::memory_order_relaxed);
    }
  });
  RawVector<EndId> met(scan_counts(start));
  std::vector<EdgeId> cursor(start);
  parallel_for(execution_, blocks_, 1, [&](std::int64_t b) {
    for (const auto& [lower, upper] : pairs_[b])
      met[std::atomic_ref(cursor[lower]).fetch_add(1, std::memory_order_relaxed)] = upper;
    std::vector<Pair>().swap(pairs_[b]);
  });
  table_.first.assign(ends + 1, 0);
  parallel_for(execution_, ends, kGrain, [&](std::int64_t k) {
    const auto begin = met.begin() + start[k], end = met.begin() + start[k + 1];
    std::sort(begin, end);
    table_.first[k] = static_cast<EdgeId>(std::unique(begin, end) - begin);
  });
  const EdgeId count = scan_counts(table_.first);
  table_.lower.resize(count);
  table_.upper.resize(count);
  parallel_for(execution_, ends, kGrain, [&](std::int64_t k) {
    const EdgeId n = table_.first[k + 1] - table_.first[k];
    std::copy_n(met.begin() + start[k], n, table_.upper.begin() + table_.first[k]);
    std::fill_n(table_.lower.begin() + table_.first[k], n, static_cast<EndId>(k));
  });
}

template <int Dim>
void Finder<Dim>::index_upward() {
  table_.first_upward.assign(table_.vertex.size() + 1, 0);
  for (const EndId k : table_.upper) ++table_.first_upward[k];
  scan_counts(table_.first_upward);
  table_.upward.resize(table_.upper.size());
  std::vector<EdgeId> cursor(table_.first_upward);
  for (EdgeId e = 0; e < table_.upper.size(); ++e) table_.upward[cursor[table_.upper[e]]++] = e;
}

}  // namespace

template <int Dim>
EdgeTable separated_edges(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, Execution& execution) {
  return Finder<Dim>(lattice, labels, execution).run();
}

template EdgeTable separated_edges(const SimplexLattice<2>&, const VertexLabels&, Execution&);
template EdgeTable separated_edges(const SimplexLattice<3>&, const VertexLabels&, Execution&);

}  // namespace treemarch
