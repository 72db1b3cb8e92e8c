#include "treemarch/core/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>

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

}  // namespace
}  // namespace treemarch
