#include "treemarch/field/junction.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "treemarch/core/solve.h"

namespace treemarch {
namespace {

constexpr int kMost = 8;
using Weights = std::array<double, kMost>;

template <int Dim>
Weights weights_at(const Field<Dim>& field, const Vec<Dim>& x, std::span<const MaterialId> labels) {
  std::array<LabelWeight, 24> found;
  const int count = field.sample(x, found);
  Weights w{};
  for (std::size_t k = 0; k < labels.size(); ++k)
    for (int i = 0; i < count; ++i)
      if (found[i].material == labels[k]) w[k] = found[i].weight;
  return w;
}

}  // namespace

template <int Dim>
float best_difference(const Field<Dim>& field, const Vec<Dim>& x, std::span<const MaterialId> a,
                      std::span<const MaterialId> b) {
  if (a.size() == 1 && b.size() == 1) return field.difference(x, a[0], b[0]);
  const auto best = [&](std::span<const MaterialId> labels) {
    float w = 0;
    for (const MaterialId m : labels) w = std::max(w, field.weight(x, m));
    return w;
  };
  return best(a) - best(b);
}

template <int Dim>
MaterialId heaviest(const Field<Dim>& field, const Vec<Dim>& x, std::span<const MaterialId> labels) {
  MaterialId best = labels[0];
  float best_weight = field.weight(x, best);
  for (const MaterialId m : labels.subspan(1)) {
    const float w = field.weight(x, m);
    if (w == best_weight) {
      const MaterialId own = field.voxel_label(x);
      Vec<Dim> centre;
      for (int d = 0; d < Dim; ++d) centre[d] = (std::floor(x[d] / field.spacing()[d]) + 0.5) * field.spacing()[d];
      if (best == own || (m != own && field.difference(centre, m, best) <= 0)) continue;
    } else if (w < best_weight) {
      continue;
    }
    best = m;
    best_weight = w;
  }
  return best;
}

template <int Dim>
Vec<Dim> move_to_junction(const Field<Dim>& field, Vec<Dim> x, std::span<const MaterialId> labels, unsigned fixed_axes,
                          int steps) {
  const int n = static_cast<int>(std::min<std::size_t>(labels.size(), kMost));
  const Vec<Dim>& voxel = field.spacing();
  for (int step = 0; step < steps; ++step) {
    const Weights here = weights_at(field, x, labels);
    const auto [least, most] = std::minmax_element(here.begin(), here.begin() + n);
    if (*most - *least < 1e-4) break;
    // Rows of the Jacobian are the gradients of w_k less their mean, in units of voxels: no label comes first.
    const auto mean = [&](const Weights& w) {
      double sum = 0;
      for (int k = 0; k < n; ++k) sum += w[k];
      return sum / n;
    };
    std::array<Vec<Dim>, kMost> row{};
    for (int d = 0; d < Dim; ++d) {
      if (fixed_axes >> d & 1) continue;
      constexpr double kStep = 0.25;
      Vec<Dim> up = x, down = x;
      up[d] += kStep * voxel[d];
      down[d] -= kStep * voxel[d];
      const Weights w_up = weights_at(field, up, labels), w_down = weights_at(field, down, labels);
      const double up_mean = mean(w_up), down_mean = mean(w_down);
      for (int k = 0; k < n; ++k) row[k][d] = (w_up[k] - up_mean - w_down[k] + down_mean) / (2 * kStep);
    }
    std::array<Vec<Dim>, Dim> normal{};
    Vec<Dim> right{};
    double trace = 0;
    const double here_mean = mean(here);
    for (int k = 0; k < n; ++k)
      for (int i = 0; i < Dim; ++i) {
        right[i] -= row[k][i] * (here[k] - here_mean);
        for (int j = 0; j < Dim; ++j) normal[i][j] += row[k][i] * row[k][j];
        trace += row[k][i] * row[k][i];
      }
    if (trace < 1e-6) break;
    for (int i = 0; i < Dim; ++i) normal[i][i] += 1e-3 * trace;
    const Vec<Dim> move = solve_definite<Dim>(normal, right);
    const double length = norm(move), scale = length > 0.5 ? 0.5 / length : 1;
    for (int d = 0; d < Dim; ++d)
      if (!(fixed_axes >> d & 1)) x[d] += scale * move[d] * voxel[d];
  }
  return x;
}

template float best_difference(const Field<2>&, const Vec<2>&, std::span<const MaterialId>,
                               std::span<const MaterialId>);
template float best_difference(const Field<3>&, const Vec<3>&, std::span<const MaterialId>,
                               std::span<const MaterialId>);
template MaterialId heaviest(const Field<2>&, const Vec<2>&, std::span<const MaterialId>);
template MaterialId heaviest(const Field<3>&, const Vec<3>&, std::span<const MaterialId>);
template Vec<2> move_to_junction(const Field<2>&, Vec<2>, std::span<const MaterialId>, unsigned, int);
template Vec<3> move_to_junction(const Field<3>&, Vec<3>, std::span<const MaterialId>, unsigned, int);

}  // namespace treemarch
