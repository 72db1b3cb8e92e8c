#include "treemarch/march/separate.h"

#include <algorithm>
#include <array>

namespace treemarch {

namespace {

template <int Dim>
double lead_over_the_rest(const Field<Dim>& field, const Vec<Dim>& point, MaterialId material) {
  std::array<LabelWeight, 2> best{};
  const int n = field.sample(point, best);
  if (best[0].material == material) return best[0].weight - (n > 1 ? double{best[1].weight} : 0.0);
  const bool second = n > 1 && best[1].material == material;
  return double{second ? best[1].weight : field.weight(point, material)} - best[0].weight;
}

}  // namespace

template <int Dim>
MaterialField<Dim> against_the_rest(const Field<Dim>& field) {
  return [&field](MaterialId material, std::span<const Vec<Dim>> points, std::span<double> values) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      values[i] = std::clamp(0.5 + 0.5 * lead_over_the_rest(field, points[i], material), 0.0, 1.0);
    }
  };
}

template MaterialField<2> against_the_rest<2>(const Field<2>&);
template MaterialField<3> against_the_rest<3>(const Field<3>&);

}  // namespace treemarch
