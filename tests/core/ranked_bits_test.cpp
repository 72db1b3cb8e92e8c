#include "treemarch/core/ranked_bits.h"

#include <gtest/gtest.h>

#include <set>

namespace treemarch {
namespace {

TEST(RankedBits, NumbersMembersBeyond32Bits) {
  // Numbers around every power of two up to 2^32, in a set of 0.8 GB.
  constexpr std::int64_t kEnd = (std::int64_t{1} << 32) + 1000;
  std::set<std::int64_t> members;
  for (int bit = 0; bit <= 32; ++bit)
    for (const std::int64_t step : {-1, 0, 1, 63, 64}) members.insert((std::int64_t{1} << bit) + step);
  members.insert(kEnd - 1);
  RankedBits bits(kEnd);
  for (const std::int64_t m : members) bits.insert(m);
  const Execution execution(2);
  ASSERT_EQ(bits.number(execution), std::ssize(members));
  std::uint32_t rank = 0;
  for (const std::int64_t m : members) {
    EXPECT_TRUE(bits.contains(m));
    EXPECT_EQ(bits.contains(m + 2), members.contains(m + 2));
    EXPECT_EQ(bits.rank(m), rank++) << m;
  }
}

TEST(RankedBits, TakesTwoAndGivesWordsFromAnyPlace) {
  constexpr std::int64_t kEnd = 256;
  std::set<std::int64_t> members;
  RankedBits bits(kEnd);
  for (const std::int64_t i : {0, 5, 62, 63, 127, 200, 254}) {
    bits.insert_two(i);
    members.insert({i, i + 1});
  }
  for (std::int64_t from = 0; from < kEnd + 64; ++from)
    for (int k = 0; k < 64; ++k)
      EXPECT_EQ(bits.word_from(from) >> k & 1, members.contains(from + k) ? 1U : 0U) << from << ' ' << k;
}

}  // namespace
}  // namespace treemarch
