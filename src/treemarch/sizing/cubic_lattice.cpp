#include "treemarch/sizing/cubic_lattice.h"

#include <algorithm>
#include <cmath>

namespace treemarch {
namespace {

/// Cells of about `side` that fill the box.
template <int Dim>
Lattice<Dim> fill(const Vec<Dim>& box, double side) {
  Lattice<Dim> lattice;
  for (int d = 0; d < Dim; ++d) {
    lattice.extent[d] = std::max<std::int32_t>(1, static_cast<std::int32_t>(std::lround(box[d] / side)));
    lattice.unit[d] = box[d] / lattice.extent[d];
  }
  return lattice;
}

}  // namespace

template <int Dim>
double stretch(const Lattice<Dim>& lattice) {
  const auto [least, most] = std::minmax_element(lattice.unit.begin(), lattice.unit.end());
  return *most / *least;
}

template <int Dim>
SizedLattice<Dim> choose_cubic_lattice(const LabelImage<Dim>& image, double smallest, double largest) {
  constexpr double kSmallestPart = 0.8;
  const Vec<Dim> box = image.size();
  // Candidates are the sides that divide one of the axes.
  SizedLattice<Dim> best;
  double best_stretch = 0, best_side = 0;
  for (int d = 0; d < Dim; ++d) {
    const auto fewest = static_cast<std::int64_t>(std::ceil(box[d] / smallest / kSizeTolerance));
    const auto most = static_cast<std::int64_t>(std::floor(box[d] / (smallest * kSmallestPart)));
    for (std::int64_t n = std::max<std::int64_t>(1, fewest); n <= std::max(most, std::max<std::int64_t>(1, fewest));
         ++n) {
      const Lattice<Dim> lattice = fill(box, box[d] / static_cast<double>(n));
      const double ratio = std::max(stretch(lattice), kMostStretch);  // below that bound all are as good
      const double side = *std::max_element(lattice.unit.begin(), lattice.unit.end());
      const bool fits = side <= smallest * kSizeTolerance || best_side > side;
      if (best_side == 0 || (fits && (ratio < best_stretch || (ratio == best_stretch && side > best_side)))) {
        best.lattice = lattice;
        best_stretch = ratio;
        best_side = side;
      }
    }
  }
  Coord<Dim> two{};
  two.fill(2);
  const auto cells = *std::max_element(best.lattice.extent.begin(), best.lattice.extent.end());
  for (int level = 0; level < 16; ++level) {
    const double root = std::ldexp(best_side, level + 1);
    if (level > 0 && (root > largest * kSizeTolerance || (std::int64_t{1} << level) >= cells)) break;
    best.pattern.factors.push_back(two);
  }
  best.deepest_level = best.pattern.finest_level();
  return best;
}

template double stretch(const Lattice<2>&);
template double stretch(const Lattice<3>&);
template SizedLattice<2> choose_cubic_lattice(const LabelImage<2>&, double, double);
template SizedLattice<3> choose_cubic_lattice(const LabelImage<3>&, double, double);

}  // namespace treemarch
