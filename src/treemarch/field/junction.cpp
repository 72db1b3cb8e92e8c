#include "treemarch/field/junction.h"

#include <algorithm>
#include <array>
#include <cmath>

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

/// Solves the symmetric positive definite system m y = r in place, by elimination without pivots.
template <int Dim>
Vec<Dim> solve(std::array<Vec<Dim>, Dim> m, Vec<Dim> r) {
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j) {
      const double f = m[j][i] / m[i][i];
      for (int k = i; k < Dim; ++k) m[j][k] -= f * m[i][k];
      r[j] -= f * r[i];
    }
  for (int i = Dim; i-- > 0;) {
    for (int k = i + 1; k < Dim; ++k) r[i] -= m[i][k] * r[k];
    r[i] /= m[i][i];
  }
  return r;
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
Vec<Dim> move_to_junction(const Field<Dim>& field, Vec<Dim> x, std::span<const MaterialId> labels, unsigned fixed_axes,
                          int steps) {
  const int n = static_cast<int>(std::min<std::size_t>(labels.size(), kMost));
  const Vec<Dim>& voxel = field.spacing();
  for (int step = 0; step < steps; ++step) {
    const Weights here = weights_at(field, x, labels);
    double worst = 0;
    for (int k = 1; k < n; ++k) worst = std::max(worst, std::abs(here[k] - here[0]));
    if (worst < 1e-4) break;
    // Rows of the Jacobian are the gradients of w_k - w_0, in units of voxels.
    std::array<Vec<Dim>, kMost> row{};
    for (int d = 0; d < Dim; ++d) {
      if (fixed_axes >> d & 1) continue;
      constexpr double kStep = 0.25;
      Vec<Dim> up = x, down = x;
      up[d] += kStep * voxel[d];
      down[d] -= kStep * voxel[d];
      const Weights w_up = weights_at(field, up, labels), w_down = weights_at(field, down, labels);
      for (int k = 1; k < n; ++k) row[k][d] = (w_up[k] - w_up[0] - w_down[k] + w_down[0]) / (2 * kStep);
    }
    std::array<Vec<Dim>, Dim> normal{};
    Vec<Dim> right{};
    double trace = 0;
    for (int k = 1; k < n; ++k)
      for (int i = 0; i < Dim; ++i) {
        right[i] -= row[k][i] * (here[k] - here[0]);
        for (int j = 0; j < Dim; ++j) normal[i][j] += row[k][i] * row[k][j];
        trace += row[k][i] * row[k][i];
      }
    if (trace < 1e-6) break;
    for (int i = 0; i < Dim; ++i) normal[i][i] += 1e-3 * trace;
    const Vec<Dim> move = solve<Dim>(normal, right);
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
template Vec<2> move_to_junction(const Field<2>&, Vec<2>, std::span<const MaterialId>, unsigned, int);
template Vec<3> move_to_junction(const Field<3>&, Vec<3>, std::span<const MaterialId>, unsigned, int);

}  // namespace treemarch
