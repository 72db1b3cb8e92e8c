/// \file
/// Union and find.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>

#include "treemarch/core/execution.h"
#include "treemarch/core/parallel.h"

namespace treemarch {

/// Disjoint sets that several threads may join at once. The roots are the smallest members whatever the order.
class SharedDisjointSets {
 public:
  using Index = std::uint32_t;
  SharedDisjointSets() = default;
  SharedDisjointSets(std::size_t n, const Execution& execution)
      : parent_(std::make_unique_for_overwrite<Index[]>(n)), size_(n) {
    parallel_for(execution, static_cast<std::int64_t>(n), 1 << 18,
                 [&](std::int64_t i) { parent_[i] = static_cast<Index>(i); });
  }

  Index find(Index i) const {
    while (true) {
      Index up = at(i).load(std::memory_order_relaxed);
      if (up == i) return i;
      const Index above = at(up).load(std::memory_order_relaxed);
      if (above != up) at(i).compare_exchange_weak(up, above, std::memory_order_relaxed);
      i = above;
    }
  }
  void join(Index a, Index b) {
    if (at(a).load(std::memory_order_relaxed) == at(b).load(std::memory_order_relaxed)) return;
    while (true) {
      a = find(a);
      b = find(b);
      if (a == b) return;
      Index root = std::max(a, b);
      if (at(root).compare_exchange_strong(root, std::min(a, b), std::memory_order_relaxed)) return;
    }
  }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool is_root(Index i) const { return parent_[i] == i; }

 private:
  [[nodiscard]] std::atomic_ref<Index> at(Index i) const { return std::atomic_ref(parent_[i]); }
  std::unique_ptr<Index[]> parent_;  // finding shortens the paths
  std::size_t size_ = 0;
};

}  // namespace treemarch
