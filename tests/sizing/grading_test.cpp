#include "treemarch/sizing/grading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "support/trees.h"

namespace treemarch {
namespace {

/// By its definition, level by level from fine to coarse: cells within reach of one that has the level.
std::vector<std::uint8_t> expected(const SizedLattice<2>& sized, int reach, std::vector<std::uint8_t> levels) {
  const Coord<2>& extent = sized.lattice.extent;
  for (int l = sized.pattern.finest_level(); l > 0; --l) {
    const Coord<2> side = sized.pattern.cell_extent(l);
    const auto before = levels;
    for (std::int64_t i = 0; i < product(extent); ++i)
      for (std::int64_t k = 0; k < product(extent); ++k) {
        const Coord<2> a = coord_of(i, extent), b = coord_of(k, extent);
        bool near = before[k] >= l;
        for (int d = 0; d < 2; ++d) near = near && std::abs(a[d] / side[d] - b[d] / side[d]) <= reach;
        if (near) levels[i] = std::max(levels[i], static_cast<std::uint8_t>(l));
      }
  }
  return levels;
}

TEST(Grading, LeavesRoomForCellsOfEachLevel) {
  for (const char* pattern : {"2", "3"}) {
    SizedLattice<2> sized;
    sized.pattern = testing::pattern_of<2>({pattern, pattern, pattern});
    sized.lattice.extent = {37, 29};
    sized.deepest_level = 3;
    const auto levels = testing::random_levels(37 * 29, 3, 4, 0.003);
    for (const double grading : {1.0, 0.5, 0.4, 0.25}) {
      auto graded = levels;
      limit_growth(sized, grading, graded, Execution(2));
      const int reach = grading == 1 ? 0 : grading == 0.5 ? 1 : grading == 0.4 ? 2 : 3;
      EXPECT_EQ(graded, reach == 0 ? levels : expected(sized, reach, levels)) << pattern << " " << grading;
    }
  }
}

}  // namespace
}  // namespace treemarch
