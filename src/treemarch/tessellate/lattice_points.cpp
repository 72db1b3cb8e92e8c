#include "treemarch/tessellate/lattice_points.h"

#include <limits>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kWordsPerBlock = 4096;

}  // namespace

template <int Dim>
std::int64_t LatticePoints<Dim>::number(const Execution& execution) {
  const auto n = static_cast<std::int64_t>(words_.size());
  std::vector<std::int64_t> first(static_cast<std::size_t>(block_count(n, kWordsPerBlock)));
  const auto blocks = static_cast<std::int64_t>(first.size());
  const auto for_words = [&](std::int64_t block, auto&& work) {
    for (std::int64_t w = block * kWordsPerBlock; w < std::min(n, (block + 1) * kWordsPerBlock); ++w) work(w);
  };
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::int64_t count = 0;
    for_words(b, [&](std::int64_t w) { count += std::popcount(words_[w]); });
    first[b] = count;
  });
  const std::int64_t total = exclusive_scan(std::span(first));
  if (total > std::numeric_limits<VertexId>::max())
    throw Error(ErrorKind::limits, "--min-size: the mesh would have " + std::to_string(total) +
                                       " vertices, more than 4294967295; choose a larger size");
  first_.resize(words_.size());
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::int64_t next = first[b];
    for_words(b, [&](std::int64_t w) {
      first_[w] = static_cast<VertexId>(next);
      next += std::popcount(words_[w]);
    });
  });
  return total;
}

template <int Dim>
std::vector<Vec<Dim>> LatticePoints<Dim>::positions(const Lattice<Dim>& lattice, const Execution& execution) const {
  const auto n = static_cast<std::int64_t>(words_.size());
  const std::int64_t total = n == 0 ? 0 : first_.back() + std::int64_t{std::popcount(words_.back())};
  std::vector<Vec<Dim>> points(static_cast<std::size_t>(total));
  parallel_for(execution, n, kWordsPerBlock, [&](std::int64_t w) {
    std::size_t id = first_[w];
    for (std::uint64_t rest = words_[w]; rest != 0; rest &= rest - 1) {
      std::int64_t key = w * 64 + std::countr_zero(rest);
      Vec<Dim> x{};
      for (int d = Dim; d-- > 0;) {
        x[d] = 0.5 * static_cast<double>(key / stride_[d]) * lattice.unit[d];
        key %= stride_[d];
      }
      points[id++] = x;
    }
  });
  return points;
}

template class LatticePoints<1>;
template class LatticePoints<2>;
template class LatticePoints<3>;
template class LatticePoints<4>;

}  // namespace treemarch
