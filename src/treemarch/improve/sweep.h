/// \file
/// Moving many vertices at once, deterministically.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
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

/// Who moves before whom: of each vertex those around it that have a smaller hash.
template <int Dim>
class Turns {
 public:
  /// \param vertices each once, all with stars
  Turns(const Patch<Dim>& patch, std::vector<VertexId> vertices, const Execution& execution)
      : vertices_(std::move(vertices)),
        end_(vertices_.size()),
        before_(static_cast<std::size_t>(block_count(std::ssize(vertices_), kPerTask))) {
    std::vector<std::uint32_t> place(patch.chosen().size(), 0);  // 1 + that in vertices_
    for (std::size_t i = 0; i < vertices_.size(); ++i)
      place[patch.slot(vertices_[i])] = static_cast<std::uint32_t>(i + 1);
    const auto is_before = [](VertexId w, VertexId v) {
      const std::uint64_t a = scramble(w), b = scramble(v);
      return a != b ? a < b : w < v;
    };
    parallel_for(execution, std::ssize(before_), 1, [&](std::int64_t task) {
      std::vector<std::uint32_t>& found = before_[task];
      for (std::int64_t i = task * kPerTask; i < std::min(std::ssize(vertices_), (task + 1) * kPerTask); ++i) {
        const auto begin = std::ssize(found);
        for (const CellId c : patch.star(vertices_[i]))
          for (const VertexId w : patch.cell(c)) {
            const std::int64_t slot = patch.slot(w);
            if (slot < 0 || place[slot] == 0 || !is_before(w, vertices_[i])) continue;
            if (std::find(found.begin() + begin, found.end(), place[slot] - 1) == found.end())
              found.push_back(place[slot] - 1);
          }
        end_[i] = static_cast<std::uint32_t>(found.size());
      }
    });
  }
  [[nodiscard]] const std::vector<VertexId>& vertices() const { return vertices_; }
  /// Those before a vertex. Vertices are given by their places in vertices().
  [[nodiscard]] std::span<const std::uint32_t> before(std::uint32_t i) const {
    const std::uint32_t begin = i % kPerTask == 0 ? 0 : end_[i - 1];
    return {before_[i / kPerTask].data() + begin, end_[i] - begin};
  }

 private:
  static constexpr std::int64_t kPerTask = 1024;
  std::vector<VertexId> vertices_;
  std::vector<std::uint32_t> end_;                  // of each vertex in the list of its task
  std::vector<std::vector<std::uint32_t>> before_;  // by tasks
};

/// Moves each candidate once, neighbours never at the same time: a vertex moves when none around it that comes before
/// it still waits. The same result for any number of threads.
/// \param is_candidate one a vertex of `turns`. \param find_place bool(VertexId v, Vec<Dim>& x): whether v shall move,
/// and where to; called from many threads, and may read what lies in the cells around v only. Moves that the guard of
/// the patch refuses are left out. \return number of vertices that moved. \pre the cells are those that `turns` saw
template <int Dim, class FindPlace>
std::int64_t sweep(Patch<Dim>& patch, const Turns<Dim>& turns, std::span<const std::uint8_t> is_candidate,
                   const Execution& execution, FindPlace&& find_place) {
  enum State : std::uint8_t { kWaiting, kMoved, kDone };
  std::vector<std::uint8_t> state(is_candidate.size(), kDone);
  std::vector<std::uint32_t> waiting, now, later;
  for (std::uint32_t i = 0; i < is_candidate.size(); ++i) {
    if (is_candidate[i] == 0) continue;
    state[i] = kWaiting;
    waiting.push_back(i);
  }
  std::int64_t moved = 0;
  while (!waiting.empty()) {
    now.clear();
    later.clear();
    for (const std::uint32_t i : waiting) {
      const bool is_first = std::ranges::all_of(turns.before(i), [&](std::uint32_t j) { return state[j] == kDone; });
      (is_first ? now : later).push_back(i);
    }
    parallel_for(execution, std::ssize(now), 16, [&](std::int64_t k) {
      const VertexId v = turns.vertices()[now[k]];
      Vec<Dim> x;
      if (!find_place(v, x) || !patch.keeps_anchors(v, x)) return;
      patch.move(v, x);
      state[now[k]] = kMoved;
    });
    for (const std::uint32_t i : now) {
      moved += state[i] == kMoved;
      state[i] = kDone;
    }
    waiting.swap(later);
  }
  return moved;
}

/// The same with all of some vertices.
template <int Dim, class FindPlace>
std::int64_t sweep(Patch<Dim>& patch, const std::vector<VertexId>& candidates, const Execution& execution,
                   FindPlace&& find_place) {
  const std::vector<std::uint8_t> all(candidates.size(), 1);
  return sweep(patch, Turns<Dim>(patch, candidates, execution), all, execution, find_place);
}

}  // namespace treemarch
