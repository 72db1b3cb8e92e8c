#include "treemarch/improve/stratum.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "treemarch/core/scramble.h"

namespace treemarch {
namespace {

/// Calls use(rim) for each facet of each cell around v that has v, with its other vertices ascending.
template <int Dim, class Use>
void for_rims(const Patch<Dim>& patch, VertexId v, Use&& use) {
  for (const CellId c : patch.star(v)) {
    const SimplexVertices<Dim> cell = patch.cell(c);
    for (int skip = 0; skip <= Dim; ++skip) {
      if (cell[skip] == v) continue;
      std::array<VertexId, Dim - 1> rim{};
      int n = 0;
      for (int k = 0; k <= Dim; ++k)
        if (k != skip && cell[k] != v) rim[n++] = cell[k];
      if (rim.back() < rim.front()) std::swap(rim.front(), rim.back());
      use(rim);
    }
  }
}

/// Whether no facet around v has one cell only: each comes twice, so that sums (xor) of their hashes cancel.
template <int Dim>
bool is_closed(const Patch<Dim>& patch, VertexId v) {
  std::uint64_t sum = 0;
  for_rims(patch, v, [&](const auto& rim) { sum ^= scramble((std::uint64_t{rim.front()} << 32U | rim.back()) + 1); });
  return sum == 0;
}

/// Whether the facets around v that have one cell all lie on the box.
template <int Dim>
bool hull_is_box(const Patch<Dim>& patch, VertexId v, unsigned box_axes) {
  if (box_axes == 0) return is_closed(patch, v);
  std::vector<std::array<VertexId, Dim - 1>> rims;
  for_rims(patch, v, [&](const auto& rim) { rims.push_back(rim); });
  std::ranges::sort(rims);
  for (std::size_t i = 0; i < rims.size(); ++i) {
    if (i + 1 < rims.size() && rims[i] == rims[i + 1]) {
      ++i;
      continue;
    }
    unsigned axes = box_axes;
    for (const VertexId w : rims[i])
      for (int d = 0; d < Dim; ++d)
        if (patch.point(w)[d] != patch.point(v)[d]) axes &= ~(1U << d);
    if (axes == 0) return false;
  }
  return true;
}

}  // namespace

void Stratum::add(MaterialId m) {
  const auto end = material.begin() + count, at = std::lower_bound(material.begin(), end, m);
  if ((at != end && *at == m) || count == kMost) return;
  std::move_backward(at, end, end + 1);
  *at = m;
  ++count;
}

template <int Dim>
unsigned box_axes(const Vec<Dim>& x, const Vec<Dim>& box) {
  unsigned axes = 0;
  for (int d = 0; d < Dim; ++d)
    if (std::abs(x[d]) <= 1e-9 * box[d] || std::abs(x[d] - box[d]) <= 1e-9 * box[d]) axes |= 1U << d;
  return axes;
}

template <int Dim>
Stratum stratum_of(const Patch<Dim>& patch, VertexId v, const Vec<Dim>& box, const Field<Dim>& field) {
  Stratum s;
  MaterialId last = kOutside;
  for (const CellId c : patch.star(v))
    if (patch.material(c) != last) s.add(last = patch.material(c));
  s.fixed_axes = box_axes(patch.point(v), box);
  if (hull_is_box(patch, v, s.fixed_axes)) return s;
  s.open = true;
  std::array<LabelWeight, 8> found;
  const int n = field.sample(patch.point(v), found);
  for (int i = 0; i < n; ++i)
    if (!std::ranges::binary_search(s.materials(), found[i].material)) {
      s.add(found[i].material);
      break;
    }
  return s;
}

template <int Dim>
Constraint<Dim>::Constraint(const Field<Dim>& field, const Stratum& stratum, const Vec<Dim>& x)
    : field_(field), stratum_(stratum) {
  int free = 0;
  for (int d = 0; d < Dim; ++d) free += !(stratum.fixed_axes >> d & 1);
  freedom_ = std::max(0, free - (stratum.count - 1));
  rows_ = stratum.count - 1;
  if (rows_ == 0) return;
  known_ = !field.linear_along_edges() && rows_ <= free;
  if (!known_) return;
  double voxel = field.spacing()[0];
  for (const double h : field.spacing()) voxel = std::min(voxel, h);
  for (int d = 0; d < Dim; ++d) {
    if (stratum.fixed_axes >> d & 1) continue;
    const double step = 0.25 * field.spacing()[d];
    Vec<Dim> up = x, down = x;
    up[d] += step;
    down[d] -= step;
    const Residual a = residual(up), b = residual(down);
    for (int k = 0; k < rows_; ++k) jacobian_[k][d] = (a[k] - b[k]) / (2 * step);
  }
  for (int k = 0; k < rows_; ++k) {
    Vec<Dim> n = jacobian_[k];
    for (int j = 0; j < k; ++j) n = n - dot(n, normal_[j]) * normal_[j];
    const double length = norm(n);
    // A weight that changes by less than this over a voxel (or only as another one does) has no surface to follow.
    known_ = known_ && length * voxel > 0.03;
    if (!known_) return;
    normal_[k] = (1 / length) * n;
  }
}

template <int Dim>
typename Constraint<Dim>::Residual Constraint<Dim>::residual(const Vec<Dim>& x) const {
  Residual r{};
  const auto m = stratum_.materials();
  if (m.size() == 2) {
    r[0] = field_.difference(x, m[1], m[0]);
    return r;
  }
  std::array<LabelWeight, 24> found;
  const int n = field_.sample(x, found);
  const auto weight = [&](MaterialId material) {
    for (int i = 0; i < n; ++i)
      if (found[i].material == material) return double{found[i].weight};
    return 0.0;
  };
  const double first = weight(m[0]);
  for (std::size_t k = 1; k < m.size(); ++k) r[k - 1] = weight(m[k]) - first;
  return r;
}

template <int Dim>
Vec<Dim> Constraint<Dim>::along(Vec<Dim> d) const {
  d = on_box(d);
  for (int k = 0; k < rows_ && known_; ++k) d = d - dot(d, normal_[k]) * normal_[k];
  return d;
}

template <int Dim>
Vec<Dim> Constraint<Dim>::on_box(Vec<Dim> d) const {
  for (int k = 0; k < Dim; ++k)
    if (stratum_.fixed_axes >> k & 1) d[k] = 0;
  return d;
}

template <int Dim>
Vec<Dim> Constraint<Dim>::to_stratum(const Vec<Dim>& y) const {
  Vec<Dim> move{};
  if (rows_ == 0) return move;
  const Residual r = residual(y);
  // The rows are triangular in the orthonormal basis: forward substitution for the components of the move.
  std::array<double, Dim> c{};
  for (int k = 0; k < rows_; ++k) {
    double right = -r[k];
    for (int j = 0; j < k; ++j) right -= dot(jacobian_[k], normal_[j]) * c[j];
    c[k] = right / dot(jacobian_[k], normal_[k]);
    move = move + c[k] * normal_[k];
  }
  return move;
}

template unsigned box_axes(const Vec<2>&, const Vec<2>&);
template unsigned box_axes(const Vec<3>&, const Vec<3>&);
template Stratum stratum_of(const Patch<2>&, VertexId, const Vec<2>&, const Field<2>&);
template Stratum stratum_of(const Patch<3>&, VertexId, const Vec<3>&, const Field<3>&);
template class Constraint<2>;
template class Constraint<3>;

}  // namespace treemarch
