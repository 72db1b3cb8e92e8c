/// \file
/// The one place where threads are used. Every function gives the same result for any number of threads, as long as the
/// work on different indices is independent.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
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
