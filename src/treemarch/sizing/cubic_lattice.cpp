#include "treemarch/sizing/cubic_lattice.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// Cells of about `side` that fill the box, a multiple of `multiple` along each axis.
template <int Dim>
Lattice<Dim> fill(const Vec<Dim>& box, double side, std::int32_t multiple) {
  Lattice<Dim> lattice;
  for (int d = 0; d < Dim; ++d) {
    const auto count = static_cast<std::int32_t>(std::lround(box[d] / side / multiple));
    lattice.extent[d] = multiple * std::max<std::int32_t>(1, count);
    lattice.unit[d] = box[d] / lattice.extent[d];
  }
  return lattice;
}

/// About how many leaves interfaces and the sides of the box need, if the former have as much area as half the latter:
/// an odd number of cells along an axis puts a layer of smallest ones onto a side of the box, twice an odd number one
/// of the next larger ones.
template <int Dim>
double leaf_estimate(const Lattice<Dim>& lattice) {
  double sum = 0;
  for (int d = 0; d < Dim; ++d) {
    double layer = 1;
    for (int e = 0; e < Dim; ++e)
      if (e != d) layer *= lattice.extent[e];
    const int level = std::countr_zero(static_cast<std::uint32_t>(lattice.extent[d]));
    sum += layer * (1 + std::ldexp(1, -(Dim - 1) * level));
  }
  return sum;
}

/// A lattice and what speaks for it.
template <int Dim>
struct Candidate {
  Lattice<Dim> lattice;
  double stretch, side, leaves;

  explicit Candidate(const Lattice<Dim>& cells)
      : lattice(cells),
        stretch(std::max(treemarch::stretch(cells), kMostStretch)),  // below that bound all are as good
        side(*std::ranges::max_element(cells.unit)),
        leaves(leaf_estimate(cells)) {}
  [[nodiscard]] bool is_better_than(const Candidate& other, double smallest) const {
    const bool fits = side <= smallest * kSizeTolerance || side < other.side;
    return fits && std::pair(stretch, leaves) < std::pair(other.stretch, other.leaves);
  }
};

/// \param smallest size of cells, or somewhat more than that if the box is small
template <int Dim>
Candidate<Dim> best_candidate(const Vec<Dim>& box, double smallest) {
  constexpr double kSmallestPart = 0.8;
  constexpr std::int32_t kMultiples[] = {1, 2, 4, 8};
  const Candidate<Dim> exact(fill(box, smallest, 1));
  if (exact.side <= smallest * kSizeTolerance && stretch(exact.lattice) <= kSizeTolerance) return exact;
  std::optional<Candidate<Dim>> best;
  for (int d = 0; d < Dim; ++d) {  // sides that divide one of the axes
    const auto fewest =
        std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(box[d] / smallest / kSizeTolerance)));
    const auto most = std::max(fewest, static_cast<std::int64_t>(box[d] / (smallest * kSmallestPart)));
    for (std::int64_t n = fewest; n <= most; ++n)
      for (const std::int32_t multiple : kMultiples) {
        const Candidate<Dim> next(fill(box, box[d] / static_cast<double>(n), multiple));
        if (!best || next.is_better_than(*best, smallest)) best = next;
      }
  }
  return *best;
}

}  // namespace

template <int Dim>
double stretch(const Lattice<Dim>& lattice) {
  const auto [least, most] = std::minmax_element(lattice.unit.begin(), lattice.unit.end());
  return *most / *least;
}

template <int Dim>
SizedLattice<Dim> choose_cubic_lattice(const LabelImage<Dim>& image, double smallest, double largest) {
  for (const double side : image.size())
    if (side / smallest > kMostCellsAlongAxis)
      throw Error(ErrorKind::limits, "--min-size: more than 2^29 cells along an axis; choose larger cells");
  const Candidate<Dim> best = best_candidate(image.size(), smallest);
  SizedLattice<Dim> sized;
  sized.lattice = best.lattice;
  Coord<Dim> two{};
  two.fill(2);
  const auto cells = *std::max_element(sized.lattice.extent.begin(), sized.lattice.extent.end());
  for (int level = 0; level < 16; ++level) {
    const double root = std::ldexp(best.side, level + 1);
    if (level > 0 && (root > largest * kSizeTolerance || (std::int64_t{1} << level) >= cells)) break;
    sized.pattern.factors.push_back(two);
  }
  sized.deepest_level = sized.pattern.finest_level();
  return sized;
}

template double stretch(const Lattice<2>&);
template double stretch(const Lattice<3>&);
template SizedLattice<2> choose_cubic_lattice(const LabelImage<2>&, double, double);
template SizedLattice<3> choose_cubic_lattice(const LabelImage<3>&, double, double);

}  // namespace treemarch
