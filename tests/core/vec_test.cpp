#include "treemarch/core/vec.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace treemarch {
namespace {

/// linear_index() and coord_of() undo each other, and steps along axes are what the extents say, all over a grid.
template <int Dim>
void check_indices(const Coord<Dim>& extent, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::int64_t count = product(extent);
  for (int round = 0; round < 1000; ++round) {
    const std::int64_t i = round == 0 ? 0 : round == 1 ? count - 1 : static_cast<std::int64_t>(random() % count);
    const Coord<Dim> c = coord_of(i, extent);
    ASSERT_EQ(linear_index(c, extent), i);
    std::int64_t stride = 1;
    for (int d = 0; d < Dim; stride *= extent[d++]) {
      ASSERT_GE(c[d], 0);
      ASSERT_LT(c[d], extent[d]);
      Coord<Dim> next = c;
      if (++next[d] < extent[d]) {
        ASSERT_EQ(linear_index(next, extent), i + stride);
      }
    }
  }
}

TEST(Indices, OfGridsBeyond32Bits) {
  constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
  check_indices<1>({kMost}, 1);
  check_indices<2>({65'537, 65'539}, 2);
  check_indices<2>({kMost, kMost}, 3);
  check_indices<3>({1291, 1291, 1291}, 4);
  check_indices<3>({2'000'003, 3, 1'500'001}, 5);
  check_indices<4>({301, 299, 307, 1009}, 6);
  EXPECT_EQ(product(Coord<3>{1291, 1291, 1291}), 2'151'685'171);
  EXPECT_EQ(product(Coord<2>{kMost, kMost}), 4'611'686'014'132'420'609);
}

}  // namespace
}  // namespace treemarch
