#include "treemarch/march/retreat.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/marks.h"

namespace treemarch {
namespace {

constexpr std::int64_t kPointsPerTask = 1 << 14;
constexpr std::array<double, 5> kFactor = {1, 0.7, 0.45, 0.2, 0};
constexpr double kLeastBarycentric = 0.15;
// A level whose high bit is set is to rise after the round.
constexpr std::uint8_t kRise = 0x80;

}  // namespace

template <int Dim>
CutGeometry<Dim>::CutGeometry(const SimplexLattice<Dim>& lattice, const Band<Dim>& band,
                              const SnappedLattice<Dim>& snapped, Points<Dim>& points, Execution& execution)
    : lattice_(lattice),
      band_(band),
      snapped_(snapped),
      points_(points),
      vertex_level_(lattice.vertices.size(), 0),
      cut_level_(snapped.edges.size(), 0),
      triple_level_(band.triangles().size(), 0) {
  // With room for cuts and for triple points.
  points_.reserve(vertex_level_.size() + cut_level_.size() + triple_level_.size());
  points_.resize(vertex_level_.size());
  parallel_for(execution, std::ssize(points_), kPointsPerTask,
               [&](std::int64_t v) { place_vertex(static_cast<VertexId>(v)); });
}

template <int Dim>
void CutGeometry<Dim>::place_vertex(VertexId v) {
  const Vec<Dim> at = snapped_.point(lattice_, v);
  points_[v] = at;
  if (vertex_level_[v] == 0) return;
  const Vec<Dim> home = lattice_.point(v);
  points_[v] = home + kFactor[vertex_level_[v]] * (at - home);
}

template <int Dim>
Vec<Dim> CutGeometry<Dim>::cut_point(EdgeId e) const {
  const double t = 0.5 + kFactor[cut_level_[e] & ~kRise] * (snapped_.cut[e] - 0.5);
  const Vec<Dim> a = points_[snapped_.edges.lower_vertex(e)], b = points_[snapped_.edges.upper_vertex(e)];
  return a + t * (b - a);
}

/// The mean of the three cuts of a triangle, kept away from its sides.
template <int Dim>
Vec<Dim> CutGeometry<Dim>::triple_point(std::int64_t i) const {
  const Triangle& v = band_.triangles()[i];
  std::array<double, 3> weight{};
  for (int k = 0; k < 3; ++k) {
    const int a = k == 2 ? 0 : k, b = k == 2 ? 2 : k + 1;  // 01, 12, 02
    const double t = snapped_.cut[snapped_.edges.find(v[a], v[b])];
    weight[a] += (1 - t) / 3;
    weight[b] += t / 3;
  }
  double sum = 0;
  for (double& w : weight) sum += w = std::max(w, kLeastBarycentric);
  const double factor = kFactor[triple_level_[i] & ~kRise];
  Vec<Dim> x{};
  for (int k = 0; k < 3; ++k) x = x + (1.0 / 3 + factor * (weight[k] / sum - 1.0 / 3)) * points_[v[k]];
  return x;
}

template <int Dim>
std::int64_t CutGeometry<Dim>::find_triple(Triangle triangle) const {
  std::sort(triangle.begin(), triangle.end());
  const auto& all = band_.triangles();
  return std::lower_bound(all.begin(), all.end(), triangle) - all.begin();
}

template <int Dim>
void CutGeometry<Dim>::find_cuts(const Simplex& simplex, unsigned cuts, Local& local) const {
  local.cuts = cuts;
  for (int e = 0; e < T::kEdges; ++e)
    if (local.cuts >> e & 1) local.edge[e] = snapped_.edges.find(simplex[T::kEdge[e][0]], simplex[T::kEdge[e][1]]);
  for (int f = 0; f < T::kFaces; ++f) {
    const auto& e = T::kFaceEdge[f];
    const auto& c = T::kFace[f];
    local.triple[f] = (local.cuts >> e[0] & local.cuts >> e[1] & local.cuts >> e[2] & 1) == 0
                          ? -1
                          : find_triple({simplex[c[0]], simplex[c[1]], simplex[c[2]]});
  }
}

template <int Dim>
void CutGeometry<Dim>::place(const Simplex& simplex, Local& local) const {
  local.placed = true;
  for (int k = 0; k <= Dim; ++k) local.point[k] = points_[simplex[k]];
  if (local.cuts == 0) return;
  for (int e = 0; e < T::kEdges; ++e)
    if (local.cuts >> e & 1) local.point[T::kCut + e] = cut_point(local.edge[e]);
  for (int f = 0; f < T::kFaces; ++f)
    if (local.triple[f] >= 0) local.point[T::kTriple + f] = triple_point(local.triple[f]);
  if constexpr (Dim == 3) {
    const auto first = local.point.begin() + (local.cuts == 63 ? T::kTriple : 0);
    local.point[T::kInner] = 0.25 * (first[0] + first[1] + first[2] + first[3]);
  }
}

/// Keys: long edges first, then cuts near the middle, then the edge's number.
template <int Dim>
unsigned CutGeometry<Dim>::pattern_of(const Simplex& simplex, const Local& local) const {
  std::array<std::tuple<std::int64_t, std::int64_t, EdgeId>, T::kEdges> key;
  for (int e = 0; e < T::kEdges; ++e) {
    if (!(local.cuts >> e & 1)) continue;
    const VertexId u = simplex[T::kEdge[e][0]], v = simplex[T::kEdge[e][1]];
    std::int64_t squared = 0;
    for (int d = 0; d < Dim; ++d) {
      const std::int64_t c = lattice_.vertices[v][d] - lattice_.vertices[u][d];
      squared += c * c;
    }
    const double t = snapped_.cut[local.edge[e]];
    key[e] = {-squared, std::llround(std::abs(t - 0.5) * (1 << 20)), local.edge[e]};
  }
  std::array<std::uint8_t, T::kEdges> rank{};
  for (int e = 0; e < T::kEdges; ++e)
    for (int other = 0; other < T::kEdges; ++other)
      if (other != e && (local.cuts >> other & local.cuts >> e & 1)) rank[e] += key[other] < key[e];
  return stencil_pattern<Dim>(local.cuts, rank);
}

template <int Dim>
StencilChoice CutGeometry<Dim>::choose(const Local& local, unsigned pattern, bool inner) const {
  constexpr unsigned kAllCut = (1U << T::kEdges) - 1;
  const Stencil<Dim>& all = stencil<Dim>(pattern);
  StencilChoice best = best_choice<Dim>(all, local.point, Dim == 3 && local.cuts == kAllCut, enough_);
  if (Dim == 3 && inner && !meets(best.angles, floor_)) best = best_choice<Dim>(all, local.point, true, enough_);
  return best;
}

template <int Dim>
template <class F>
void CutGeometry<Dim>::for_levels(const Simplex& simplex, unsigned cuts, F&& f) {
  Local local;
  find_cuts(simplex, cuts, local);
  for (const VertexId v : simplex) f(vertex_level_[v]);
  for (int e = 0; e < T::kEdges; ++e)
    if (local.cuts >> e & 1) f(cut_level_[local.edge[e]]);
  for (int t = 0; t < T::kFaces; ++t)
    if (local.triple[t] >= 0) f(triple_level_[local.triple[t]]);
}

template <int Dim>
bool CutGeometry<Dim>::settle(const Simplex& simplex, unsigned cuts, bool inner, SplitRecord& split) const {
  if (cuts == 0 || cuts == Band<Dim>::kOneLabel) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = points_[simplex[k]];
    return meets(p, sure_) || meets(angle_range<Dim>(p), floor_);
  }
  Local local;
  find_cuts(simplex, cuts, local);
  place(simplex, local);
  const unsigned pattern = pattern_of(simplex, local);
  const StencilChoice best = choose(local, pattern, inner);
  split.pattern = pattern & 0x3ffU;
  split.choice = static_cast<unsigned>(best.choice) & 0x3fU;
  return meets(best.angles, floor_);
}

template <int Dim>
std::vector<std::uint32_t> CutGeometry<Dim>::settle_block(std::int64_t block, std::span<const std::uint32_t> chosen,
                                                          bool inner) {
  std::vector<std::uint32_t> failed;
  const auto simplices = band_.simplices(block);
  const auto cuts = band_.cuts(block);
  for (const std::uint32_t i : chosen) {
    if (settle(simplices[i], cuts[i], inner, split_[band_.first(block) + i])) continue;
    failed.push_back(i);
    for_levels(simplices[i], cuts[i],
               [](std::uint8_t& level) { std::atomic_ref(level).fetch_or(kRise, std::memory_order_relaxed); });
  }
  return failed;
}

template <int Dim>
std::vector<VertexId> CutGeometry<Dim>::raise(const std::vector<std::vector<std::uint32_t>>& failed,
                                              Execution& execution) {
  const auto rise = [](std::uint8_t& level) {
    const std::atomic_ref place(level);
    std::uint8_t now = place.load(std::memory_order_relaxed);
    const auto next = [&] { return static_cast<std::uint8_t>(std::min<int>((now & ~kRise) + 1, kLevels - 1)); };
    while ((now & kRise) != 0 && !place.compare_exchange_weak(now, next(), std::memory_order_relaxed)) {
    }
  };
  Marks vertices(vertex_level_.size());
  parallel_for(execution, std::ssize(failed), 1, [&](std::int64_t block) {
    for (const std::uint32_t i : failed[block]) {
      const Simplex& simplex = band_.simplices(block)[i];
      for_levels(simplex, band_.cuts(block)[i], rise);
      for (const VertexId v : simplex) vertices.mark(v);
    }
  });
  std::vector<VertexId> raised = vertices.vertices();
  parallel_for(execution, std::ssize(raised), kPointsPerTask, [&](std::int64_t i) { place_vertex(raised[i]); });
  return raised;
}

/// By the box around the stars of its leaves, which reach as far as the centre of a neighbour twice as large.
template <int Dim>
bool CutGeometry<Dim>::may_touch(std::int64_t block, std::span<const VertexId> vertices) const {
  constexpr std::size_t kFew = 512;
  if (vertices.size() > kFew) return true;
  Coord<Dim> low = lattice_.extent, high{};
  const std::int64_t first = block * kLeavesPerBlock;
  for (std::int64_t i = first; i < std::min(first + kLeavesPerBlock, std::ssize(lattice_.leaves)); ++i) {
    const Leaf<Dim>& leaf = lattice_.leaves[i];
    const std::int32_t side = lattice_.sides[leaf.level];
    for (int d = 0; d < Dim; ++d) {
      low[d] = std::min(low[d], 2 * (leaf.corner[d] - side));
      high[d] = std::max(high[d], 2 * (leaf.corner[d] + 2 * side));
    }
  }
  return std::ranges::any_of(vertices, [&](VertexId v) {
    bool inside = true;
    for (int d = 0; d < Dim; ++d) inside &= lattice_.vertices[v][d] >= low[d] && lattice_.vertices[v][d] <= high[d];
    return inside;
  });
}

template <int Dim>
void CutGeometry<Dim>::retreat(double quality_floor, Execution& execution) {
  constexpr int kWithoutInner = 2;   // rounds
  constexpr int kMostRounds = 1000;  // far more than levels can rise one by one around a vertex
  constexpr double kSure = 1e-6;     // degrees above the floor, more than rounding can make
  floor_ = QualityBound(quality_floor);
  sure_ = SquaredQualityBound(QualityBound(quality_floor + kSure));
  split_ = filled(execution, band_.size(), SplitRecord{});
  std::vector<std::vector<std::uint32_t>> failed(band_.blocks());
  parallel_for(execution, band_.blocks(), 1, [&](std::int64_t block) {
    std::vector<std::uint32_t> all(band_.simplices(block).size());
    std::iota(all.begin(), all.end(), 0U);
    failed[block] = settle_block(block, all, false);
  });
  for (rounds = 0; std::ranges::any_of(failed, [](const auto& some) { return !some.empty(); }); ++rounds) {
    if (rounds == kMostRounds)
      throw std::logic_error("the quality floor is above the bound of the lattice's undisplaced stencils");
    // Every point of a simplex that can have changed is near a vertex of it that is marked: cuts and triple points rise
    // only together with all vertices of the failing simplex.
    const std::vector<VertexId> raised = raise(failed, execution);
    Marks rose(vertex_level_.size());
    for (const VertexId v : raised) rose.mark(v);
    parallel_for(execution, band_.blocks(), 1, [&](std::int64_t block) {
      failed[block].clear();
      if (!may_touch(block, raised)) return;
      const auto simplices = band_.simplices(block);
      std::vector<std::uint32_t> near;
      for (std::uint32_t i = 0; i < simplices.size(); ++i)
        if (std::ranges::any_of(simplices[i], [&](VertexId v) { return rose[v]; })) near.push_back(i);
      failed[block] = settle_block(block, near, rounds + 1 >= kWithoutInner);
    });
  }
  const auto count = [](const std::vector<std::uint8_t>& levels) {
    return std::count_if(levels.begin(), levels.end(), [](std::uint8_t l) { return l != 0; });
  };
  retreated = count(vertex_level_) + count(cut_level_) + count(triple_level_);
}

template class CutGeometry<2>;
template class CutGeometry<3>;

}  // namespace treemarch
