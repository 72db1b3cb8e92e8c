#include "treemarch/march/edge_table.h"

#include <algorithm>
#include <atomic>
#include <bit>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 4096;

template <int Dim, class F>
void for_separated_pairs(const std::array<VertexId, Dim + 1>& simplex, const VertexLabels& labels, F&& f) {
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j)
      if (labels.disjoint(simplex[i], simplex[j]))
        f(std::min(simplex[i], simplex[j]), std::max(simplex[i], simplex[j]));
}

void list_ends(EdgeTable& table, std::int64_t count, Execution& execution) {
  table.vertex.resize(count);
  const auto& words = table.ends.words();
  parallel_for(execution, static_cast<std::int64_t>(words.size()), kGrain, [&](std::int64_t w) {
    EndId next = table.ends.first_of_word(static_cast<std::size_t>(w));
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1)
      table.vertex[next++] = static_cast<VertexId>(w * 64 + std::countr_zero(rest));
  });
}

/// Lists the simplices with a separated edge and marks the ends in those with one label.
template <int Dim>
void find_mixed(const Band<Dim>& band, const VertexLabels& labels, EdgeTable& table, Execution& execution) {
  constexpr std::int64_t kBlock = 1 << 14;
  const auto n = static_cast<std::int64_t>(band.simplices().size());
  table.supported.assign(table.vertex.size(), 0);
  std::vector<std::vector<std::uint32_t>> found(block_count(n, kBlock));
  parallel_for(execution, static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t block) {
    for (std::int64_t i = block * kBlock; i < std::min(n, (block + 1) * kBlock); ++i) {
      const auto& simplex = band.simplices()[i];
      bool uniform = true;
      for (int k = 1; k <= Dim; ++k) uniform &= labels.same_single(simplex[0], simplex[k]);
      if (uniform) {
        for (const VertexId v : simplex) {
          if (!table.ends.contains(v)) continue;
          std::atomic_ref<std::uint8_t> mark(table.supported[table.end_of(v)]);
          if (!mark.load(std::memory_order_relaxed)) mark.store(1, std::memory_order_relaxed);
        }
        continue;
      }
      bool any = false;
      for_separated_pairs<Dim>(simplex, labels, [&](VertexId, VertexId) { any = true; });
      if (any) found[block].push_back(static_cast<std::uint32_t>(i));
    }
  });
  for (const auto& block : found) table.mixed.insert(table.mixed.end(), block.begin(), block.end());
}

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

void index_upward(EdgeTable& table) {
  table.first_upward.assign(table.vertex.size() + 1, 0);
  for (const EndId k : table.upper) ++table.first_upward[k];
  scan_counts(table.first_upward);
  table.upward.resize(table.upper.size());
  std::vector<EdgeId> cursor(table.first_upward);
  for (EdgeId e = 0; e < table.upper.size(); ++e) table.upward[cursor[table.upper[e]]++] = e;
}

}  // namespace

template <int Dim>
EdgeTable separated_edges(const Band<Dim>& band, const VertexLabels& labels, Execution& execution) {
  EdgeTable table;
  table.ends = band.ends();
  list_ends(table, band.end_count(), execution);
  find_mixed(band, labels, table, execution);
  const auto ends = static_cast<std::int64_t>(table.vertex.size());
  const auto simplices = static_cast<std::int64_t>(table.mixed.size());
  // Every edge is met once a simplex that has it: collect all by their lower vertex, then drop the repeats.
  std::vector<EdgeId> start(ends + 1, 0);
  parallel_for(execution, simplices, kGrain, [&](std::int64_t i) {
    for_separated_pairs<Dim>(band.simplices()[table.mixed[i]], labels, [&](VertexId u, VertexId) {
      std::atomic_ref<EdgeId>(start[table.end_of(u)]).fetch_add(1, std::memory_order_relaxed);
    });
  });
  std::vector<EndId> met(scan_counts(start));
  std::vector<EdgeId> cursor(start);
  parallel_for(execution, simplices, kGrain, [&](std::int64_t i) {
    for_separated_pairs<Dim>(band.simplices()[table.mixed[i]], labels, [&](VertexId u, VertexId v) {
      const std::atomic_ref<EdgeId> at(cursor[table.end_of(u)]);
      met[at.fetch_add(1, std::memory_order_relaxed)] = table.end_of(v);
    });
  });
  table.first.assign(ends + 1, 0);
  parallel_for(execution, ends, kGrain, [&](std::int64_t k) {
    const auto begin = met.begin() + start[k], end = met.begin() + start[k + 1];
    std::sort(begin, end);
    table.first[k] = static_cast<EdgeId>(std::unique(begin, end) - begin);
  });
  const EdgeId count = scan_counts(table.first);
  table.lower.resize(count);
  table.upper.resize(count);
  parallel_for(execution, ends, kGrain, [&](std::int64_t k) {
    const EdgeId n = table.first[k + 1] - table.first[k];
    std::copy_n(met.begin() + start[k], n, table.upper.begin() + table.first[k]);
    std::fill_n(table.lower.begin() + table.first[k], n, static_cast<EndId>(k));
  });
  index_upward(table);
  return table;
}

template EdgeTable separated_edges(const Band<2>&, const VertexLabels&, Execution&);
template EdgeTable separated_edges(const Band<3>&, const VertexLabels&, Execution&);

}  // namespace treemarch
