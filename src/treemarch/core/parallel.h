/// \file
/// The one place where threads are used. Every function gives the same result for any number of threads, as long as the
/// work on different indices is independent.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"

namespace treemarch {

/// Calls work(begin, end) for disjoint ranges that cover [0, n), at least `grain` indices each where possible.
template <class Work>
void parallel_for_ranges(const Execution& execution, std::int64_t n, std::int64_t grain, Work&& work) {
  execution.check();
  if (n <= 0) return;
  execution.run([&] {
    tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, n, std::max<std::int64_t>(1, grain)),
                      [&](const tbb::blocked_range<std::int64_t>& r) {
                        execution.check();
                        work(r.begin(), r.end());
                      });
  });
}

/// Calls work(i) for every i in [0, n).
template <class Work>
void parallel_for(const Execution& execution, std::int64_t n, std::int64_t grain, Work&& work) {
  parallel_for_ranges(execution, n, grain, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) work(i);
  });
}

/// Calls make(i, slot) for every i in [0, n), several at a time, and use(i, slot) for each after that, one after the
/// other in ascending order, while others are made. What make() leaves in a slot, a number below `slots`, stays there
/// until use() has seen it.
template <class Make, class Use>
void parallel_in_order(const Execution& execution, std::int64_t n, std::size_t slots, Make&& make, Use&& use) {
  using tbb::filter_mode;
  execution.check();
  // An item enters when fewer than `slots` are on their way, and they leave in order: each has a slot of its own.
  const auto slot = [&](std::int64_t i) { return static_cast<std::size_t>(i) % slots; };
  std::int64_t next = 0;
  const auto enter =
      tbb::make_filter<void, std::int64_t>(filter_mode::serial_in_order, [&](tbb::flow_control& control) {
        if (next == n) control.stop();
        return next++;
      });
  const auto work = tbb::make_filter<std::int64_t, std::int64_t>(filter_mode::parallel, [&](std::int64_t i) {
    execution.check();
    make(i, slot(i));
    return i;
  });
  const auto leave =
      tbb::make_filter<std::int64_t, void>(filter_mode::serial_in_order, [&](std::int64_t i) { use(i, slot(i)); });
  execution.run([&] { tbb::parallel_pipeline(slots, enter & work & leave); });
}

/// Sorts by `less`, which must be a strict total order, so that the result does not depend on the threads.
template <class T, class Less = std::less<T>>
void parallel_sort(const Execution& execution, std::vector<T>& values, Less less = {}) {
  execution.check();
  execution.run([&] { tbb::parallel_sort(values.begin(), values.end(), less); });
}

/// A vector of n times a value, set by all threads: the memory of a large one costs more than its values.
template <class T>
RawVector<T> filled(const Execution& execution, std::size_t n, const T& value) {
  constexpr std::int64_t kGrain = 1 << 16;
  RawVector<T> all(n);
  parallel_for_ranges(execution, static_cast<std::int64_t>(n), kGrain, [&](std::int64_t begin, std::int64_t end) {
    std::fill(all.begin() + begin, all.begin() + end, value);
  });
  return all;
}

/// Splits [0, n) into fixed blocks of `block` indices (the last one may be shorter), independent of the threads: the
/// way to fill variable-length output deterministically is count per block, exclusive_scan(), then fill per block.
[[nodiscard]] constexpr std::int64_t block_count(std::int64_t n, std::int64_t block) { return (n + block - 1) / block; }

/// Replaces counts by the sums of those before them and returns the total.
template <class T>
T exclusive_scan(std::span<T> counts) {
  T sum{};
  for (T& c : counts) {
    const T n = c;
    c = sum;
    sum += n;
  }
  return sum;
}

/// What several lists hold, one after the other; leaves them empty.
template <class T>
RawVector<T> joined(const Execution& execution, std::vector<std::vector<T>>& lists) {
  std::vector<std::size_t> first;
  first.reserve(lists.size());
  for (const auto& list : lists) first.push_back(list.size());
  RawVector<T> all(exclusive_scan(std::span(first)));
  parallel_for(execution, static_cast<std::int64_t>(lists.size()), 1, [&](std::int64_t i) {
    const auto list = static_cast<std::size_t>(i);
    std::ranges::copy(lists[list], all.begin() + static_cast<std::ptrdiff_t>(first[list]));
    lists[list] = {};
  });
  return all;
}

/// Sum (or another associative combination) over fixed blocks, combined in the order of the blocks.
/// work(begin, end) returns the value of one block.
template <class T, class Work, class Combine = std::plus<T>>
T parallel_reduce(const Execution& execution, std::int64_t n, std::int64_t block, T init, Work&& work,
                  Combine combine = {}) {
  std::vector<T> partial(static_cast<std::size_t>(block_count(n, block)), init);
  parallel_for(execution, static_cast<std::int64_t>(partial.size()), 1, [&](std::int64_t b) {
    partial[static_cast<std::size_t>(b)] = work(b * block, std::min(n, (b + 1) * block));
  });
  T result = init;
  for (const T& p : partial) result = combine(result, p);
  return result;
}

}  // namespace treemarch
