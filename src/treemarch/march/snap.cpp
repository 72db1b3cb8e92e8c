#include "treemarch/march/snap.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/field/junction.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 2048;

template <int Dim>
class Snapper {
 public:
  Snapper(const SimplexLattice<Dim>& lattice, const Field<Dim>& field, const SnapOptions& options, Execution& execution,
          SnappedLattice<Dim>& state)
      : lattice_(lattice),
        field_(field),
        options_(options),
        execution_(execution),
        state_(state),
        weights_(state.edges.vertex.size()),
        moved_(state.edges.vertex.size(), 1),
        depth_(state.edges.vertex.size()),
        support_(state.edges.vertex.size()) {}

  void run() {
    state_.cut.resize(state_.edges.size());
    weigh_ends();
    for (int round = 0; round < options_.rounds; ++round) {
      locate_cuts();
      if (snap_round() == 0) break;
    }
    locate_cuts();
    parallel_for(execution_, static_cast<std::int64_t>(state_.cut.size()), kGrain, [&](std::int64_t e) {
      if (state_.cut[e] < 0) return;
      const auto keep = static_cast<float>(reach(static_cast<EdgeId>(e)));
      state_.cut[e] = std::clamp(state_.cut[e], keep, 1 - keep);
    });
  }

 private:
  struct Move {
    VertexId vertex;
    EndId end;
    std::uint64_t depth;  // quantised distance to the cut, never 0; ties broken by the vertex
    LabelSet labels;
    Vec<Dim> point;
  };

  /// The part of an edge within which a cut attracts the vertex.
  [[nodiscard]] double reach(EdgeId e) const {
    const Coord<Dim>&a = lattice_.vertices[state_.edges.lower_vertex(e)],
          &b = lattice_.vertices[state_.edges.upper_vertex(e)];
    int axes = 0;
    for (int d = 0; d < Dim; ++d) axes += a[d] != b[d];
    return axes == 1 ? options_.long_edge : options_.short_edge;
  }
  [[nodiscard]] double cell_side(VertexId v) const {
    double unit = lattice_.unit[0];
    for (int d = 1; d < Dim; ++d) unit = std::min(unit, lattice_.unit[d]);
    return 2 * unit * static_cast<double>(std::int64_t{1} << lattice_.spacing[v]);
  }

  void weigh_ends();
  void locate_cuts();
  [[nodiscard]] double locate_cut(EndId from, EndId to) const;
  /// By how much the label of an end outweighs that of another end there. \pre neither has moved
  [[nodiscard]] double lead(EndId k, EndId over) const;
  std::int64_t snap_round();
  [[nodiscard]] bool propose(EndId k, Move& move) const;
  [[nodiscard]] Vec<Dim> point(VertexId v) const { return state_.point(lattice_, v); }
  void find_support();
  /// Whether a label does not vanish around the vertex when it moves.
  [[nodiscard]] bool supported(const Move& move) const {
    return !state_.labels.single(move.vertex) || state_.edges.supported[move.end] || support_[move.end] > move.depth;
  }

  const SimplexLattice<Dim>& lattice_;
  const Field<Dim>& field_;
  const SnapOptions& options_;
  Execution& execution_;
  SnappedLattice<Dim>& state_;
  /// Of an end with a single label, where it was: the weight of this and the next largest one.
  struct Weights {
    float own, next;
    MaterialId next_material;
  };
  // Of the ends of edges:
  RawVector<Weights> weights_;
  std::vector<std::uint8_t> moved_;   // in the last round; at first all
  RawVector<std::uint64_t> depth_;    // of those that want to move, else 0
  RawVector<std::uint64_t> support_;  // the largest depth of a neighbour with the same single label
};

/// Of the many edges at an end each needs them.
template <int Dim>
void Snapper<Dim>::weigh_ends() {
  parallel_for(execution_, std::ssize(weights_), kGrain, [&](std::int64_t k) {
    const VertexId v = state_.edges.vertex[k];
    weights_[k] = {0, 0, kOutside};
    if (!state_.labels.single(v)) return;
    std::array<LabelWeight, 2> most;
    const int count = field_.sample(lattice_.point(v), most);
    if (count == 2 && most[0].material == state_.labels.of(v)[0])
      weights_[k] = {most[0].weight, most[1].weight, most[1].material};
  });
}

template <int Dim>
double Snapper<Dim>::lead(EndId k, EndId over) const {
  const VertexId v = state_.edges.vertex[k];
  const MaterialId own = state_.labels.of(v)[0], other = state_.labels.of(state_.edges.vertex[over])[0];
  if (other == weights_[k].next_material) return double{weights_[k].own} - weights_[k].next;
  return field_.difference(point(v), own, other);
}

template <int Dim>
void Snapper<Dim>::locate_cuts() {
  parallel_for(execution_, static_cast<std::int64_t>(state_.edges.size()), kGrain, [&](std::int64_t e) {
    if (!moved_[state_.edges.lower[e]] && !moved_[state_.edges.upper[e]]) return;
    const EndId from = state_.edges.lower[e], to = state_.edges.upper[e];
    const bool cut = state_.labels.disjoint(state_.edges.vertex[from], state_.edges.vertex[to]);
    state_.cut[e] = cut ? static_cast<float>(locate_cut(from, to)) : -1.0F;
  });
}

/// The best weight of S(u) against the best of S(v) along the edge: a linear guess, then two steps of regula falsi;
/// long edges, on which the field is flat at both ends, take more.
template <int Dim>
double Snapper<Dim>::locate_cut(EndId from, EndId to) const {
  const VertexId u = state_.edges.vertex[from], v = state_.edges.vertex[to];
  const auto a = state_.labels.of(u), b = state_.labels.of(v);
  const Vec<Dim> x = point(u), y = point(v);
  const auto value = [&](double t) { return double{best_difference<Dim>(field_, x + t * (y - x), a, b)}; };
  const bool single = state_.labels.single(u) && state_.labels.single(v);
  double low = 0, high = 1, f_low = std::max(0.0, single ? lead(from, to) : value(0)),
         f_high = std::min(0.0, single ? -lead(to, from) : value(1));
  const auto guess = [&] {
    return f_low - f_high > 0 ? low + (high - low) * f_low / (f_low - f_high) : 0.5 * (low + high);
  };
  double t = guess();
  if (field_.linear_along_edges()) return t;
  const int steps = 2 + 2 * std::max(int{lattice_.spacing[u]}, int{lattice_.spacing[v]});
  int side = 0;
  for (int step = 0; step < steps; ++step) {
    const double f = value(t);
    if (std::abs(f) < 1e-4) break;
    if (f > 0) {
      low = t, f_low = f;
      if (side == 1) f_high *= 0.5;  // the Illinois rule against one-sided convergence
      side = 1;
    } else {
      high = t, f_high = f;
      if (side == -1) f_low *= 0.5;
      side = -1;
    }
    t = guess();
  }
  return t;
}

/// A vertex that wants to move needs a neighbour of its own single label that stays or lies deeper inside: so the
/// deepest vertex of every part of a label stays, and no label is lost.
template <int Dim>
void Snapper<Dim>::find_support() {
  constexpr std::uint64_t kStays = ~std::uint64_t{0};
  const auto& thin = state_.edges.thin;
  parallel_for(execution_, static_cast<std::int64_t>(thin.size()) / (Dim + 1), kGrain, [&](std::int64_t i) {
    const VertexId* simplex = thin.data() + i * (Dim + 1);
    std::array<std::uint64_t, Dim + 1> depth{};
    std::array<EndId, Dim + 1> end{};
    for (int k = 0; k <= Dim; ++k) {
      if (!state_.edges.ends.contains(simplex[k])) continue;
      end[k] = state_.edges.end_of(simplex[k]);
      depth[k] = depth_[end[k]];
    }
    for (int v = 0; v <= Dim; ++v) {
      if (depth[v] == 0) continue;
      for (int w = 0; w <= Dim; ++w) {
        if (w == v || !state_.labels.same_single(simplex[v], simplex[w])) continue;
        const std::uint64_t other = depth[w] ? depth[w] : kStays;
        std::atomic_ref<std::uint64_t> most(support_[end[v]]);
        std::uint64_t seen = most.load(std::memory_order_relaxed);
        while (seen < other && !most.compare_exchange_weak(seen, other, std::memory_order_relaxed)) {
        }
      }
    }
  });
}

template <int Dim>
std::int64_t Snapper<Dim>::snap_round() {
  constexpr std::int64_t kBlock = 4096;
  const auto n = static_cast<std::int64_t>(depth_.size());
  std::vector<std::vector<Move>> moves(block_count(n, kBlock));
  parallel_for(execution_, static_cast<std::int64_t>(moves.size()), 1, [&](std::int64_t block) {
    Move move;
    for (std::int64_t k = block * kBlock; k < std::min(n, (block + 1) * kBlock); ++k) {
      support_[k] = 0;
      depth_[k] = 0;
      if (!propose(static_cast<EndId>(k), move)) continue;
      moves[block].push_back(move);
      depth_[k] = move.depth;
    }
  });
  find_support();
  parallel_for(execution_, std::ssize(moves), 1, [&](std::int64_t block) {
    std::erase_if(moves[block], [&](const Move& move) { return !supported(move); });
  });
  std::ranges::fill(moved_, 0);
  std::int64_t count = 0;
  for (const auto& block : moves)
    for (const Move& move : block) {
      state_.snapped += state_.labels.single(move.vertex);
      state_.labels.set_many(move.vertex, move.labels);
      if (state_.labels.set_count() > state_.points.size()) state_.points.emplace_back();
      state_.points[state_.labels.set_number(move.vertex)] = move.point;
      moved_[move.end] = 1;
      ++count;
    }
  return count;
}

/// The vertex takes the nearest of the cuts within reach, by quantised distance, then by the other end.
template <int Dim>
bool Snapper<Dim>::propose(EndId end, Move& move) const {
  const VertexId v = state_.edges.vertex[end];
  const unsigned fixed = lattice_.hull_axes(v);
  if (fixed == (1U << Dim) - 1) return false;
  const double most_reach = std::max(options_.short_edge, options_.long_edge);
  const Vec<Dim> here = point(v);
  std::pair<std::int64_t, Coord<Dim>> nearest{std::numeric_limits<std::int64_t>::max(), {}};
  VertexId other = v;
  double at = 0;
  state_.edges.for_edges_at(end, [&](EdgeId e, EndId w_end) {
    if (state_.cut[e] < 0) return;
    const double t = end < w_end ? state_.cut[e] : 1 - state_.cut[e];
    if (t > most_reach || t > reach(e)) return;
    const VertexId w = state_.edges.vertex[w_end];
    const double distance = t * norm(point(w) - here) / cell_side(v);
    const std::pair<std::int64_t, Coord<Dim>> key{std::llround(distance * (1 << 20)), lattice_.vertices[w]};
    if (key < nearest) nearest = key, other = w, at = t;
  });
  if (other == v) return false;
  const Vec<Dim> cut = here + at * (point(other) - here);
  const auto ends = state_.labels.of(other);
  const MaterialId gained = ends.size() == 1 ? ends[0] : heaviest<Dim>(field_, cut, ends);
  move.vertex = v;
  move.end = end;
  move.depth = (static_cast<std::uint64_t>(nearest.first + 1) << 32) | v;
  move.labels = state_.labels.set_of(v);
  if (move.labels.size() == LabelSet::kMost) return false;
  move.labels.insert(gained);
  const bool on_cut = move.labels.size() == 2 && (fixed & ~lattice_.hull_axes(other)) == 0;
  move.point = on_cut ? cut : move_to_junction(field_, here, move.labels.items(), fixed);
  const Vec<Dim> home = lattice_.point(v);
  const double distance = norm(move.point - home), most = options_.max_displacement * cell_side(v);
  if (distance > most) move.point = home + (most / distance) * (move.point - home);
  return true;
}

}  // namespace

template <int Dim>
SnappedLattice<Dim> snap_vertices(const SimplexLattice<Dim>& lattice, VertexLabels&& labels, const Field<Dim>& field,
                                  const SnapOptions& options, Execution& execution) {
  SnappedLattice<Dim> state;
  state.labels = std::move(labels);
  state.edges = separated_edges(lattice, state.labels, execution);
  state.points.resize(state.labels.set_count());
  parallel_for(execution, static_cast<std::int64_t>(lattice.vertices.size()), 4 * kGrain, [&](std::int64_t i) {
    const auto v = static_cast<VertexId>(i);
    if (!state.labels.single(v)) state.points[state.labels.set_number(v)] = lattice.point(v);
  });
  Snapper<Dim>(lattice, field, options, execution, state).run();
  return state;
}

template SnappedLattice<2> snap_vertices(const SimplexLattice<2>&, VertexLabels&&, const Field<2>&, const SnapOptions&,
                                         Execution&);
template SnappedLattice<3> snap_vertices(const SimplexLattice<3>&, VertexLabels&&, const Field<3>&, const SnapOptions&,
                                         Execution&);

}  // namespace treemarch
