/// \file
/// A set of integers that numbers its members by their rank.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"

namespace treemarch {

/// A set of integers in [0, n), one bit each and 32 more for every 64: members are numbered in ascending order without
/// a sort or a search.
class RankedBits {
 public:
  explicit RankedBits(std::int64_t n = 0) : words_(static_cast<std::size_t>((n + 63) / 64), 0) {}

  /// May be called from several threads at once, together with contains().
  void insert(std::int64_t i) {
    std::atomic_ref<std::uint64_t> word(words_[static_cast<std::size_t>(i >> 6)]);
    const std::uint64_t bit = std::uint64_t{1} << (i & 63);
    if ((word.load(std::memory_order_relaxed) & bit) == 0) word.fetch_or(bit, std::memory_order_relaxed);
  }
  /// Inserts i and i + 1.
  void insert_two(std::int64_t i) {
    if ((i & 63) == 63) {
      insert(i);
      insert(i + 1);
      return;
    }
    std::atomic_ref<std::uint64_t> word(words_[static_cast<std::size_t>(i >> 6)]);
    const std::uint64_t bits = std::uint64_t{3} << (i & 63);
    if ((word.load(std::memory_order_relaxed) & bits) != bits) word.fetch_or(bits, std::memory_order_relaxed);
  }
  [[nodiscard]] bool contains(std::int64_t i) const {
    const std::atomic_ref<std::uint64_t> word(const_cast<std::uint64_t&>(words_[static_cast<std::size_t>(i >> 6)]));
    return (word.load(std::memory_order_relaxed) >> (i & 63) & 1) != 0;
  }

  /// Numbers the members; call once after the last insert(). Returns how many there are; ranks are those of the first
  /// 2^32 only.
  std::int64_t number(const Execution& execution);
  /// How many members are smaller than i. \pre number() was called.
  [[nodiscard]] std::uint32_t rank(std::int64_t i) const {
    const auto w = static_cast<std::size_t>(i >> 6);
    return first_[w] + count(words_[w] & ((std::uint64_t{1} << (i & 63)) - 1));
  }
  /// Which of the 64 integers from i on are members, a bit each; none from n on. \pre nobody inserts
  [[nodiscard]] std::uint64_t word_from(std::int64_t i) const {
    const auto w = static_cast<std::size_t>(i >> 6);
    const int shift = static_cast<int>(i & 63);
    if (w >= words_.size()) return 0;
    std::uint64_t word = words_[w] >> shift;
    if (shift != 0 && w + 1 < words_.size()) word |= words_[w + 1] << (64 - shift);
    return word;
  }
  /// Sets of 64 members each, and the number of the first member of each.
  [[nodiscard]] const std::vector<std::uint64_t>& words() const { return words_; }
  [[nodiscard]] std::uint32_t first_of_word(std::size_t w) const { return first_[w]; }

 private:
  /// std::popcount() is a call where the processor is not known to count.
  static constexpr std::uint32_t count(std::uint64_t x) {
    x -= x >> 1 & 0x5555555555555555ULL;
    x = (x & 0x3333333333333333ULL) + (x >> 2 & 0x3333333333333333ULL);
    x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fULL;
    return static_cast<std::uint32_t>(x * 0x0101010101010101ULL >> 56);
  }
  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> first_;  // number of the first member of each word
};

}  // namespace treemarch
