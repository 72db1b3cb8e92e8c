#include "treemarch/core/ranked_bits.h"

#include "treemarch/core/parallel.h"

namespace treemarch {

std::int64_t RankedBits::number(const Execution& execution) {
  constexpr std::int64_t kWordsPerBlock = 4096;
  const auto n = static_cast<std::int64_t>(words_.size());
  std::vector<std::int64_t> first(static_cast<std::size_t>(block_count(n, kWordsPerBlock)));
  const auto blocks = static_cast<std::int64_t>(first.size());
  const auto for_words = [&](std::int64_t block, auto&& work) {
    for (std::int64_t w = block * kWordsPerBlock; w < std::min(n, (block + 1) * kWordsPerBlock); ++w) work(w);
  };
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::int64_t members = 0;
    for_words(b, [&](std::int64_t w) { members += count(words_[w]); });
    first[b] = members;
  });
  const std::int64_t total = exclusive_scan(std::span(first));
  first_.resize(words_.size());
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::int64_t next = first[b];
    for_words(b, [&](std::int64_t w) {
      first_[w] = static_cast<std::uint32_t>(next);
      next += count(words_[w]);
    });
  });
  return total;
}

}  // namespace treemarch
