#include "treemarch/core/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace treemarch {
namespace {

TEST(Parallel, FilledSetsEveryElement) {
  const Execution execution(2);
  for (const std::size_t n : {0U, 1U, 65536U, 200001U}) {
    const auto all = filled(execution, n, 7);
    ASSERT_EQ(all.size(), n);
    EXPECT_EQ(std::ranges::count(all, 7), std::ssize(all));
  }
}

TEST(Parallel, JoinedKeepsTheOrderOfLists) {
  for (const int threads : {1, 3}) {
    std::vector<std::vector<int>> lists{{}, {1, 2, 3}, {}, {4}, {5, 6}};
    const auto all = joined(Execution(threads), lists);
    EXPECT_EQ(std::vector<int>(all.begin(), all.end()), (std::vector<int>{1, 2, 3, 4, 5, 6}));
    for (const auto& list : lists) EXPECT_TRUE(list.empty());
  }
}

TEST(Parallel, WhatIsUsedInOrderIsMadeOnce) {
  for (const int threads : {1, 3})
    for (const std::int64_t n : {0, 1, 2, 5, 1000}) {
      std::vector<std::int64_t> slots(5, -1), used;
      parallel_in_order(
          Execution(threads), n, slots.size(), [&](std::int64_t i, std::size_t slot) { slots[slot] = i * i; },
          [&](std::int64_t i, std::size_t slot) {
            EXPECT_EQ(i, std::ssize(used));
            used.push_back(slots[slot]);
          });
      ASSERT_EQ(std::ssize(used), n);
      for (std::int64_t i = 0; i < n; ++i) EXPECT_EQ(used[static_cast<std::size_t>(i)], i * i);
    }
}

TEST(Parallel, ErrorsOfWhatIsMadeInOrderArrive) {
  const auto fail_at = [](std::int64_t at) {
    parallel_in_order(
        Execution(2), 100, 4,
        [&](std::int64_t i, std::size_t) {
          if (i == at) throw std::runtime_error("made");
        },
        [](std::int64_t, std::size_t) {});
  };
  EXPECT_THROW(fail_at(0), std::runtime_error);
  EXPECT_THROW(fail_at(57), std::runtime_error);
  EXPECT_NO_THROW(fail_at(100));
}

}  // namespace
}  // namespace treemarch
