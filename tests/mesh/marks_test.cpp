#include "treemarch/mesh/marks.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

TEST(Marks, RunsBySeveralThreadsAreThePlacesOneByOne) {
  constexpr std::size_t kSize = 1000;
  struct Run {
    std::size_t first, count;
  };
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    std::vector<Run> runs(20);
    for (Run& run : runs) {
      run.first = random() % kSize;
      run.count = random() % std::min<std::size_t>(150, kSize - run.first + 1);
    }
    Marks by_runs(kSize);
    parallel_for(Execution(2), std::ssize(runs), 1, [&](std::int64_t i) {
      by_runs.mark_run(runs[static_cast<std::size_t>(i)].first, runs[static_cast<std::size_t>(i)].count);
    });
    std::vector<bool> expected(kSize);
    for (const Run& run : runs) std::fill_n(expected.begin() + static_cast<std::ptrdiff_t>(run.first), run.count, true);
    for (std::size_t v = 0; v < kSize; ++v) ASSERT_EQ(by_runs[v], expected[v]) << v;
  }
}

}  // namespace
}  // namespace treemarch
