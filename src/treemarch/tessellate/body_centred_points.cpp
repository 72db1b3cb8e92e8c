#include "treemarch/tessellate/body_centred_points.h"

#include <bit>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kWordsPerTask = 1024;

}  // namespace

template <int Dim>
BodyCentredPoints<Dim>::BodyCentredPoints(const Coord<Dim>& cells) : cells_(cells), even_extent_(cells) {
  std::int64_t even = 1, odd = 1;
  for (int d = 0; d < Dim; ++d) {
    ++even_extent_[d];
    even_stride_[d] = even;
    odd_stride_[d] = odd;
    even *= even_extent_[d];
    odd *= cells_[d];
  }
  first_odd_ = even;
  std::int64_t next = even + odd;
  for (int side = 0; side < 2 * Dim; ++side) {
    first_on_side_[side] = next;
    if constexpr (Dim == 3) next += odd / cells_[side / 2];
  }
  first_on_side_[2 * Dim] = next;
  bits_ = RankedBits(next);
}

template <int Dim>
std::int64_t BodyCentredPoints<Dim>::key(const Coord<Dim>& half) const {
  Coord<Dim> c = half;
  unsigned odd = 0;
  for (int d = 0; d < Dim; ++d) {
    odd |= (static_cast<unsigned>(half[d]) & 1U) << d;
    c[d] >>= 1;
  }
  if (odd == 0) return even_key(c);
  if (odd == (1U << Dim) - 1) return odd_key(c);
  const int axis = std::countr_one(odd);  // the even coordinate, which lies on the hull
  Coord<Dim> extent = cells_;
  extent[axis] = 1;
  const int side = 2 * axis + (c[axis] != 0);
  c[axis] = 0;
  return first_on_side_[side] + linear_index(c, extent);
}

template <int Dim>
Coord<Dim> BodyCentredPoints<Dim>::point_of(std::int64_t key) const {
  int side = -1;
  Coord<Dim> c{};
  if (key < first_odd_) {
    c = coord_of(key, even_extent_);
    for (std::int32_t& x : c) x *= 2;
    return c;
  }
  if (key < first_on_side_[0]) {
    c = coord_of(key - first_odd_, cells_);
  } else {
    for (side = 0; key >= first_on_side_[side + 1];) ++side;
    Coord<Dim> extent = cells_;
    extent[side / 2] = 1;
    c = coord_of(key - first_on_side_[side], extent);
  }
  for (std::int32_t& x : c) x = 2 * x + 1;
  if (side >= 0) c[side / 2] = side % 2 ? 2 * cells_[side / 2] : 0;
  return c;
}

template <int Dim>
RawVector<Coord<Dim>> BodyCentredPoints<Dim>::coordinates(std::int64_t size, const Execution& execution) const {
  RawVector<Coord<Dim>> points(static_cast<std::size_t>(size));
  const auto& words = bits_.words();
  parallel_for(execution, static_cast<std::int64_t>(words.size()), kWordsPerTask, [&](std::int64_t w) {
    if (words[w] == 0) return;
    std::size_t id = bits_.first_of_word(static_cast<std::size_t>(w));
    // Points of one word mostly lie in one row: the first axis is stepped along, the rest only found anew at its end.
    std::int64_t row_end = 0, last = 0;
    Coord<Dim> point{};
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1) {
      const std::int64_t key = w * 64 + std::countr_zero(rest);
      if (key < row_end) {
        point[0] += static_cast<std::int32_t>(2 * (key - last));
      } else {
        point = point_of(key);
        const bool even = key < first_odd_, on_hull = key >= first_on_side_[0];
        row_end = on_hull ? key : key + (even ? cells_[0] - point[0] / 2 : cells_[0] - 1 - point[0] / 2) + 1;
      }
      last = key;
      points[id++] = point;
    }
  });
  return points;
}

template class BodyCentredPoints<2>;
template class BodyCentredPoints<3>;

}  // namespace treemarch
