#include "treemarch/march/edge_table.h"

#include <algorithm>
#include <atomic>

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

/// Lists the simplices with a separated edge and marks the vertices of those with one label.
template <int Dim>
void find_mixed(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, EdgeTable& table,
                Execution& execution) {
  constexpr std::int64_t kBlock = 1 << 15;
  const auto n = static_cast<std::int64_t>(lattice.simplices.size());
  if (n >= static_cast<std::int64_t>(kNoEdge))
    throw Error(ErrorKind::limits, "--min-size: more than 2^32 lattice simplices; choose larger cells");
  table.supported.assign(lattice.vertices.size(), 0);
  std::vector<std::vector<std::uint32_t>> found(block_count(n, kBlock));
  parallel_for(execution, static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t block) {
    for (std::int64_t i = block * kBlock; i < std::min(n, (block + 1) * kBlock); ++i) {
      const auto& simplex = lattice.simplices[i];
      bool uniform = true;
      for (int k = 1; k <= Dim; ++k) uniform &= labels.same_single(simplex[0], simplex[k]);
      if (uniform) {
        for (const VertexId v : simplex) {
          std::atomic_ref<std::uint8_t> mark(table.supported[v]);
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

void index_upward(EdgeTable& table, std::size_t vertices) {
  table.first_upward.assign(vertices + 1, 0);
  for (const VertexId v : table.upper) ++table.first_upward[v];
  scan_counts(table.first_upward);
  table.upward.resize(table.upper.size());
  std::vector<EdgeId> cursor(table.first_upward);
  for (EdgeId e = 0; e < table.upper.size(); ++e) table.upward[cursor[table.upper[e]]++] = e;
}

}  // namespace

template <int Dim>
EdgeTable separated_edges(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, Execution& execution) {
  const auto vertices = static_cast<std::int64_t>(lattice.vertices.size());
  EdgeTable table;
  find_mixed(lattice, labels, table, execution);
  const auto simplices = static_cast<std::int64_t>(table.mixed.size());
  // Every edge is met once a simplex that has it: collect all by their lower vertex, then drop the repeats.
  std::vector<EdgeId> start(vertices + 1, 0);
  parallel_for(execution, simplices, kGrain, [&](std::int64_t i) {
    for_separated_pairs<Dim>(lattice.simplices[table.mixed[i]], labels, [&](VertexId u, VertexId) {
      std::atomic_ref<EdgeId>(start[u]).fetch_add(1, std::memory_order_relaxed);
    });
  });
  std::vector<VertexId> met(scan_counts(start));
  std::vector<EdgeId> cursor(start);
  parallel_for(execution, simplices, kGrain, [&](std::int64_t i) {
    for_separated_pairs<Dim>(lattice.simplices[table.mixed[i]], labels, [&](VertexId u, VertexId v) {
      met[std::atomic_ref<EdgeId>(cursor[u]).fetch_add(1, std::memory_order_relaxed)] = v;
    });
  });
  table.first.assign(vertices + 1, 0);
  parallel_for(execution, vertices, kGrain, [&](std::int64_t v) {
    const auto begin = met.begin() + start[v], end = met.begin() + start[v + 1];
    std::sort(begin, end);
    table.first[v] = static_cast<EdgeId>(std::unique(begin, end) - begin);
  });
  const EdgeId count = scan_counts(table.first);
  table.lower.resize(count);
  table.upper.resize(count);
  parallel_for(execution, vertices, kGrain, [&](std::int64_t v) {
    const EdgeId n = table.first[v + 1] - table.first[v];
    std::copy_n(met.begin() + start[v], n, table.upper.begin() + table.first[v]);
    std::fill_n(table.lower.begin() + table.first[v], n, static_cast<VertexId>(v));
  });
  index_upward(table, vertices);
  return table;
}

template EdgeTable separated_edges(const SimplexLattice<2>&, const VertexLabels&, Execution&);
template EdgeTable separated_edges(const SimplexLattice<3>&, const VertexLabels&, Execution&);

}  // namespace treemarch
