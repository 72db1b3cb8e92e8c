#include "treemarch/improve/vertex_mover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "treemarch/improve/star_check.h"

namespace treemarch {
namespace {

constexpr double kRise = 0.01;  // degrees: less is no progress
// Degrees above the worst: cells whose gradients count. Where no direction suits all of them, fewer are asked.
constexpr double kActive[] = {1.5, 0.3};

/// The cells around a vertex. Most are far above any bound that is asked for, which a test of several at once tells;
/// only angles of others are computed.
template <int Dim>
class StarShape {
 public:
  StarShape(const Patch<Dim>& patch, VertexId v) : patch_(patch), v_(v) {
    thread_local std::vector<std::array<VertexId, Dim>> others;
    others.clear();
    for (const CellId c : patch.star(v)) others.push_back(others_of<Dim>(patch.cell(c), v));
    cells_.gather(patch.points(), others);
  }

  /// The worst, if it is below a limit; otherwise something that is not. \pre limit is above 0
  [[nodiscard]] double quality_at(const Vec<Dim>& x, double limit) const {
    AngleRange all;
    visit_below(limit, x, [&](CellId c) { all.merge(angles(c, x)); });
    return quality(all);
  }
  [[nodiscard]] bool all_meet(const Vec<Dim>& x, double limit) const {
    const QualityBound bound(limit);
    bool all = true;
    visit_below(limit, x, [&](CellId c) { all = all && meets(angles(c, x), bound); });
    return all;
  }
  /// Gradients of the qualities below a limit, by differences.
  [[nodiscard]] std::vector<Vec<Dim>> gradients_below(double limit, const Vec<Dim>& x, double step) const {
    std::vector<Vec<Dim>> all;
    const QualityBound active(limit);
    visit_below(limit, x, [&](CellId c) {
      if (meets(angles(c, x), active)) return;
      Vec<Dim> g{};
      for (int d = 0; d < Dim; ++d) {
        Vec<Dim> up = x, down = x;
        up[d] += step;
        down[d] -= step;
        g[d] = (quality(angles(c, up)) - quality(angles(c, down))) / (2 * step);
      }
      all.push_back(g);
    });
    return all;
  }
  /// Of the vertices around it; each counts once for each cell that it shares with v.
  [[nodiscard]] Vec<Dim> mean() const {
    Vec<Dim> sum{};
    for_neighbours([&](const Vec<Dim>& x) { sum = sum + x; });
    return (1.0 / static_cast<double>(Dim * patch_.star(v_).size())) * sum;
  }
  /// Length of an edge.
  [[nodiscard]] double shortest() const {
    double shortest = -1;
    for_neighbours([&](const Vec<Dim>& x) {
      const double length = squared_norm(x - patch_.point(v_));
      if (shortest < 0 || length < shortest) shortest = length;
    });
    return std::sqrt(shortest);
  }

 private:
  [[nodiscard]] AngleRange angles(CellId c, const Vec<Dim>& x) const {
    const SimplexVertices<Dim> cell = patch_.cell(c);
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = cell[k] == v_ ? x : patch_.point(cell[k]);
    return angle_range<Dim>(p);
  }
  /// Calls use(c) for all cells whose quality is below a limit, and maybe for some that are hardly above it.
  template <class Use>
  void visit_below(double limit, const Vec<Dim>& x, Use&& use) const {
    constexpr double kRounding = 1e-4, kBest = 71;  // degrees; no simplex has the latter
    const auto star = patch_.star(v_);
    cells_.visit_failing(x, SquaredQualityBound(QualityBound(std::min(std::abs(limit) + kRounding, kBest))),
                         [&](std::size_t i) { use(star[i]); });
  }
  template <class Use>
  void for_neighbours(Use&& use) const {
    for (const CellId c : patch_.star(v_))
      for (const VertexId w : patch_.cell(c))
        if (w != v_) use(patch_.point(w));
  }

  const Patch<Dim>& patch_;
  VertexId v_;
  StarCheck<Dim> cells_;
};

/// The point of the hull of g that is nearest to the origin, by Frank-Wolfe steps.
template <int Dim>
Vec<Dim> nearest_in_hull(const std::vector<Vec<Dim>>& g) {
  const auto less = [](const Vec<Dim>& a, const Vec<Dim>& b) { return squared_norm(a) < squared_norm(b); };
  Vec<Dim> p = *std::ranges::min_element(g, less);
  for (int round = 0; round < 24; ++round) {
    const Vec<Dim>& to =
        *std::ranges::min_element(g, [&](const Vec<Dim>& a, const Vec<Dim>& b) { return dot(a, p) < dot(b, p); });
    const Vec<Dim> step = to - p;
    const double gain = -dot(p, step);
    if (gain <= 1e-3 * squared_norm(p)) break;
    p = p + std::min(1.0, gain / squared_norm(step)) * step;
  }
  return p;
}

/// One search for a better place.
template <int Dim>
class Search {
 public:
  Search(const Patch<Dim>& patch, VertexId v, const Field<Dim>& field, const Vec<Dim>& box, const MoveLimits& limits,
         bool loose, const Vec<Dim>& start)
      : shape_(patch, v),
        stratum_(stratum_of(patch, v, box, field)),
        constraint_(field, stratum_, patch.point(v)),
        limits_(limits),
        loose_(loose),
        start_(start),
        best_(patch.point(v)),
        reach_(limits.displacement) {}

  bool run(Vec<Dim>& x) {
    if (!can_move()) return false;
    quality_ = shape_.quality_at(best_, limits_.goal);
    if (quality_ >= limits_.goal) return false;
    shortest_ = shape_.shortest();
    if (stratum_.count == 1 || constraint_.known())
      reach_ = std::max(reach_, (stratum_.count == 1 ? limits_.inner_reach : limits_.reach) * shortest_);
    offset_ = offset(best_);
    const double first = quality_;
    for (const double part : {1.0, 0.4})
      if (quality_ == first) attempt(part * along(shape_.mean() - best_));
    for (int round = 0; round < 8 && quality_ < limits_.goal; ++round)
      if (!climb()) break;
    x = best_;
    return quality_ > first;
  }

 private:
  [[nodiscard]] bool can_move() const {
    if (loose_ || !constraint_.known()) return stratum_.fixed_axes + 1 != 1U << Dim;  // a corner of the box stays
    return constraint_.freedom() > 0;
  }
  [[nodiscard]] bool bound_to_start() const { return !constraint_.known(); }
  [[nodiscard]] Vec<Dim> along(const Vec<Dim>& d) const {
    return loose_ ? constraint_.on_box(d) : constraint_.along(d);
  }
  [[nodiscard]] double offset(const Vec<Dim>& x) const {
    return bound_to_start() ? norm(x - start_) : norm(constraint_.to_stratum(x));
  }

  bool climb() {
    return std::ranges::any_of(kActive, [&](double active) { return climb(active); });
  }
  bool climb(double active) {
    auto gradients = shape_.gradients_below(quality_ + active, best_, 1e-4 * shortest_);
    for (Vec<Dim>& g : gradients) g = along(g);
    const Vec<Dim> up = nearest_in_hull(gradients);
    const double slope = norm(up);
    if (!(slope * shortest_ > 1e-2)) return false;
    double step = 0.2 * shortest_;
    for (int halving = 0; halving < 6; ++halving, step *= 0.5)
      if (attempt((step / slope) * up)) return true;
    return false;
  }

  /// Takes a move if all cells get better than the worst was and the vertex stays true to its stratum.
  bool attempt(const Vec<Dim>& move) {
    const Vec<Dim> plain = best_ + move;
    if (loose_ || stratum_.count == 1 || bound_to_start()) return take(plain);
    const Vec<Dim> correction = constraint_.to_stratum(plain);
    if (take(plain + correction)) return true;
    return offset_ > 0.1 * limits_.slack && take(plain);
  }

  bool take(const Vec<Dim>& x) {
    if (squared_norm(x - start_) > reach_ * reach_) return false;
    if (!shape_.all_meet(x, quality_ + kRise)) return false;
    if (stratum_.count > 1) {
      const double off = offset(x);
      if (off > std::max(offset_, loose_ || bound_to_start() ? limits_.slack : 0.2 * limits_.slack)) return false;
    }
    best_ = x;
    quality_ = shape_.quality_at(x, limits_.goal);
    return true;
  }

  StarShape<Dim> shape_;
  Stratum stratum_;
  Constraint<Dim> constraint_;
  MoveLimits limits_;
  bool loose_;
  Vec<Dim> start_, best_;
  double reach_;         // from the start
  double shortest_ = 0;  // edge
  double quality_ = 0, offset_ = 0;
};

}  // namespace

template <int Dim>
bool find_better_place(const Patch<Dim>& patch, VertexId v, const Field<Dim>& field, const Vec<Dim>& box,
                       const MoveLimits& limits, bool loose, const Vec<Dim>& start, Vec<Dim>& x) {
  if (patch.fixed(v)) return false;
  return Search<Dim>(patch, v, field, box, limits, loose, start).run(x);
}

template <int Dim>
bool find_nearer_place(const Patch<Dim>& patch, VertexId v, const Field<Dim>& field, const Vec<Dim>& box,
                       const MoveLimits& limits, const Vec<Dim>& start, Vec<Dim>& x) {
  if (patch.fixed(v)) return false;
  const Vec<Dim> here = patch.point(v);
  const Stratum stratum = stratum_of(patch, v, box, field);
  const Constraint<Dim> constraint(field, stratum, here);
  if (stratum.count < 2 || !constraint.known()) return false;
  Vec<Dim> move = constraint.to_stratum(here);
  const double offset = norm(move);
  // A field is not linear over more than about a voxel.
  if (offset <= limits.slack || offset > 2 * limits.displacement) return false;
  const Vec<Dim> rest = constraint.to_stratum(here + move);
  if (norm(rest) < 0.5 * offset) move = move + rest;
  const StarShape<Dim> shape(patch, v);
  for (const double part : {1.0, 0.5, 0.25}) {
    x = here + part * move;
    if (squared_norm(x - start) <= limits.displacement * limits.displacement && shape.all_meet(x, limits.goal) &&
        norm(constraint.to_stratum(x)) < offset)
      return true;
  }
  return false;
}

template <int Dim>
double star_quality(const Patch<Dim>& patch, VertexId v) {
  AngleRange all;
  for (const CellId c : patch.star(v)) all.merge(patch.angles(patch.cell(c)));
  return quality(all);
}

template bool find_better_place(const Patch<2>&, VertexId, const Field<2>&, const Vec<2>&, const MoveLimits&, bool,
                                const Vec<2>&, Vec<2>&);
template bool find_better_place(const Patch<3>&, VertexId, const Field<3>&, const Vec<3>&, const MoveLimits&, bool,
                                const Vec<3>&, Vec<3>&);
template bool find_nearer_place(const Patch<2>&, VertexId, const Field<2>&, const Vec<2>&, const MoveLimits&,
                                const Vec<2>&, Vec<2>&);
template bool find_nearer_place(const Patch<3>&, VertexId, const Field<3>&, const Vec<3>&, const MoveLimits&,
                                const Vec<3>&, Vec<3>&);
template double star_quality(const Patch<2>&, VertexId);
template double star_quality(const Patch<3>&, VertexId);

}  // namespace treemarch
