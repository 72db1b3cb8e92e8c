/// \file
/// Moving many vertices at once, deterministically.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/scramble.h"
#include "treemarch/improve/patch.h"

namespace treemarch {

/// Who moves before whom: of each vertex those around it that have a smaller hash, by which those that come first are
/// spread over the mesh.
class Turns {
 public:
  /// \param vertices each once; those near each other in space are best near each other here
  /// \param neighbours neighbours(i, add) calls add(j) for the places in `vertices` of those around the i-th one; each
  /// may come several times, and i as well
  template <class Neighbours>
  Turns(std::vector<VertexId> vertices, const Execution& execution, const Neighbours& neighbours)
      : vertices_(std::move(vertices)),
        per_task_(std::clamp<std::int64_t>(std::ssize(vertices_) / 64, 16, 512)),
        end_(vertices_.size()),
        by_hash_(vertices_.size()),
        before_(static_cast<std::size_t>(block_count(std::ssize(vertices_), per_task_))) {
    std::vector<Rank> rank;
    rank.reserve(vertices_.size());
    for (const VertexId v : vertices_) rank.push_back({scramble(v), v});
    parallel_for(execution, std::ssize(before_), 1, [&](std::int64_t task) {
      const std::int64_t first = task * per_task_, last = std::min(std::ssize(vertices_), first + per_task_);
      std::vector<std::uint32_t>& before = before_[task];
      for (std::int64_t i = first; i < last; ++i) {
        const auto begin = std::ssize(before);
        neighbours(i, [&](std::uint32_t j) {
          if (rank[j] < rank[i] && std::find(before.rbegin(), before.rend() - begin, j) == before.rend() - begin)
            before.push_back(j);
        });
        end_[i] = static_cast<std::uint32_t>(before.size());
        by_hash_[i] = static_cast<std::uint32_t>(i);
      }
      std::ranges::sort(by_hash_.begin() + first, by_hash_.begin() + last, {},
                        [&](std::uint32_t i) { return rank[i]; });
    });
  }
  [[nodiscard]] std::size_t size() const { return vertices_.size(); }
  [[nodiscard]] VertexId vertex(std::uint32_t i) const { return vertices_[i]; }
  /// Those before a vertex. Vertices are given by their places in the list.
  [[nodiscard]] std::span<const std::uint32_t> before(std::uint32_t i) const {
    const std::uint32_t begin = i % per_task_ == 0 ? 0 : end_[i - 1];
    return {before_[i / per_task_].data() + begin, end_[i] - begin};
  }
  /// Parts of the list.
  [[nodiscard]] std::int64_t tasks() const { return std::ssize(before_); }
  /// Those of a part, the smallest hash first.
  [[nodiscard]] std::span<const std::uint32_t> of_task(std::int64_t task) const {
    const std::int64_t first = task * per_task_;
    return {by_hash_.data() + first, static_cast<std::size_t>(std::min(std::ssize(by_hash_) - first, per_task_))};
  }

 private:
  using Rank = std::pair<std::uint64_t, VertexId>;

  std::vector<VertexId> vertices_;
  std::int64_t per_task_;
  std::vector<std::uint32_t> end_;                  // of each vertex in the list of its task
  std::vector<std::uint32_t> by_hash_;              // by tasks
  std::vector<std::vector<std::uint32_t>> before_;  // by tasks
};

/// Moves each vertex once, neighbours never at the same time: a vertex moves when none around it that comes before
/// it still waits. The same result for any number of threads: whenever a vertex has its turn, those before it have
/// moved and those after it have not. A task goes over its vertices, whose surroundings stay in the cache, and again
/// while those of other tasks hold some of them up.
/// \param move bool(std::uint32_t i): moves a vertex, given by its place in the list, or not, and says so; called from
/// many threads, and may read what lies in the cells around it only.
/// \return number of vertices that moved. \pre the cells are those that `turns` saw
template <class Move>
std::int64_t sweep(const Turns& turns, const Execution& execution, const Move& move) {
  std::vector<std::uint8_t> waits(turns.size(), 1);
  struct Task {
    std::vector<std::uint32_t> waiting;
    std::int64_t moved = 0;
  };
  std::vector<Task> tasks(static_cast<std::size_t>(turns.tasks()));
  parallel_for(execution, turns.tasks(), 1, [&](std::int64_t t) {
    const auto all = turns.of_task(t);
    tasks[t].waiting.assign(all.begin(), all.end());
  });
  const auto has_turn = [&](std::uint32_t i) {
    return std::ranges::none_of(turns.before(i), [&](std::uint32_t j) {
      return std::atomic_ref(waits[j]).load(std::memory_order_acquire) != 0;
    });
  };
  std::int64_t moved = 0;
  while (!tasks.empty()) {
    parallel_for(execution, std::ssize(tasks), 1, [&](std::int64_t t) {
      Task& task = tasks[t];
      std::erase_if(task.waiting, [&](std::uint32_t i) {
        if (!has_turn(i)) return false;
        task.moved += move(i) ? 1 : 0;
        std::atomic_ref(waits[i]).store(0, std::memory_order_release);
        return true;
      });
    });
    std::erase_if(tasks, [&](const Task& task) {
      if (task.waiting.empty()) moved += task.moved;
      return task.waiting.empty();
    });
  }
  return moved;
}

/// The turns of some vertices of a patch.
/// \param candidates each once, all with stars
template <int Dim>
Turns turns_of(const Patch<Dim>& patch, const std::vector<VertexId>& candidates, const Execution& execution) {
  constexpr std::uint32_t kNone = 0xffffffffU;
  std::vector<std::uint32_t> place(patch.chosen().size(), kNone);  // in the list, by slots
  for (std::size_t i = 0; i < candidates.size(); ++i) place[patch.slot(candidates[i])] = static_cast<std::uint32_t>(i);
  return Turns(candidates, execution, [&](std::int64_t i, const auto& add) {
    for (const CellId c : patch.star(candidates[i]))
      for (const VertexId w : patch.cell(c))
        if (const std::int64_t slot = patch.slot(w); slot >= 0 && place[slot] != kNone) add(place[slot]);
  });
}

/// The same with all vertices of `turns`, which are of a patch.
/// \param find_place bool(VertexId v, Vec<Dim>& x): whether v shall move, and where to. Moves that the guard of the
/// patch refuses are left out.
template <int Dim, class FindPlace>
std::int64_t sweep(Patch<Dim>& patch, const Turns& turns, const Execution& execution, const FindPlace& find_place) {
  return sweep(turns, execution, [&](std::uint32_t i) {
    const VertexId v = turns.vertex(i);
    Vec<Dim> x;
    if (!find_place(v, x) || !patch.keeps_anchors(v, x)) return false;
    patch.move(v, x);
    return true;
  });
}

}  // namespace treemarch
