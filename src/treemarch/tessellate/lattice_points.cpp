#include "treemarch/tessellate/lattice_points.h"

#include <bit>
#include <limits>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kWordsPerBlock = 4096;

}  // namespace

template <int Dim>
std::int64_t LatticePoints<Dim>::number(const Execution& execution) {
  size_ = points_.number(execution);
  if (size_ > std::numeric_limits<VertexId>::max())
    throw Error(ErrorKind::limits, "--min-size: the mesh would have " + std::to_string(size_) +
                                       " vertices, more than 4294967295; choose a larger size");
  return size_;
}

template <int Dim>
Points<Dim> LatticePoints<Dim>::positions(const Lattice<Dim>& lattice, const Execution& execution) const {
  const auto n = static_cast<std::int64_t>(points_.words().size());
  Points<Dim> points(static_cast<std::size_t>(size_));
  parallel_for(execution, n, kWordsPerBlock, [&](std::int64_t w) {
    std::size_t id = points_.first_of_word(w);
    for (std::uint64_t rest = points_.words()[w]; rest != 0; rest &= rest - 1) {
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
