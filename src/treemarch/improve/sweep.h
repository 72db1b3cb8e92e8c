/// \file
/// Moving many vertices at once, deterministically.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"
#include "treemarch/improve/patch.h"

namespace treemarch {

/// Bits without a pattern, so that vertices which come first are spread over the mesh.
inline std::uint64_t scramble(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Moves each candidate once, neighbours never at the same time: a vertex moves when its hash is the smallest among
/// the candidates around it that have not had their turn. The same result for any number of threads.
/// \param find_place bool(VertexId v, Vec<Dim>& x): whether v shall move, and where to; called from many threads, and
/// may read what lies in the cells around v only. Moves that the guard of the patch refuses are left out. \return
/// number of vertices that moved. \pre all candidates have stars
template <int Dim, class FindPlace>
std::int64_t sweep(Patch<Dim>& patch, const std::vector<VertexId>& candidates, const Execution& execution,
                   FindPlace&& find_place) {
  std::vector<std::uint64_t> turn(patch.chosen().size(), 0);  // 0: no candidate, or done
  for (const VertexId v : candidates) turn[patch.slot(v)] = scramble(v) | 1;
  const auto first = [&](VertexId v, VertexId w) {
    const std::uint64_t a = turn[patch.slot(v)], b = patch.has_star(w) ? turn[patch.slot(w)] : 0;
    return b == 0 || a < b || (a == b && v <= w);
  };
  std::vector<VertexId> waiting = candidates, now;
  std::vector<std::uint8_t> state;
  std::int64_t moved = 0;
  while (!waiting.empty()) {
    const auto n = static_cast<std::int64_t>(waiting.size());
    state.assign(waiting.size(), 0);
    parallel_for(execution, n, 64, [&](std::int64_t i) {
      for (const CellId c : patch.star(waiting[i]))
        for (const VertexId w : patch.cell(c))
          if (!first(waiting[i], w)) return;
      state[i] = 1;
    });
    parallel_for(execution, n, 16, [&](std::int64_t i) {
      const VertexId v = waiting[i];
      if (state[i] == 0) return;
      Vec<Dim> x;
      if (!find_place(v, x) || !patch.keeps_anchors(v, x)) return;
      patch.move(v, x);
      state[i] = 2;
    });
    now.clear();
    for (std::int64_t i = 0; i < n; ++i) {
      moved += state[i] == 2;
      if (state[i] == 0)
        now.push_back(waiting[i]);
      else
        turn[patch.slot(waiting[i])] = 0;
    }
    waiting.swap(now);
  }
  return moved;
}

}  // namespace treemarch
