#include "treemarch/improve/improve.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/remesh.h"
#include "treemarch/improve/stratum.h"
#include "treemarch/improve/vertex_mover.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 14;
constexpr double kMargin = 0.01;   // degrees: cells are listed up to this above the target
constexpr double kHeadroom = 0.5;  // degrees above the target at which a vertex is left alone
constexpr double kSlack = 0.1;     // of a voxel: how far a vertex may leave its interface
constexpr int kSweeps = 8;

/// Bits without a pattern, so that vertices which come first are spread over the mesh.
std::uint64_t scramble(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

struct Scan {
  std::vector<CellId> bad;
  AngleRange angles;
  std::int64_t below = 0;
};

template <int Dim>
class Improver {
 public:
  Improver(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const ImproveOptions& options,
           Execution& execution)
      : mesh_(mesh), field_(field), box_(box), options_(options), execution_(execution) {
    double voxel = field.spacing()[0];
    for (const double h : field.spacing()) voxel = std::min(voxel, h);
    limits_.displacement = options.max_displacement > 0 ? options.max_displacement : 0.5 * voxel;
    limits_.slack = kSlack * voxel;
    limits_.goal = options.quality + kHeadroom;
  }

  ImproveReport run() {
    Scan scan = scan_cells();
    report_.below_before = report_.below_after = scan.below;
    report_.worst_before = report_.worst_after = quality(scan.angles);
    report_.stopped = ImproveStop::target_met;
    if (!scan.bad.empty()) {
      move_vertices(scan.bad);
      remesh();
      scan = scan_cells();
      report_.below_after = scan.below;
      report_.worst_after = quality(scan.angles);
    }
    return report_;
  }

 private:
  Scan scan_cells() const;
  [[nodiscard]] bool late() const {
    return options_.seconds > 0 &&
           std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count() > options_.seconds;
  }
  [[nodiscard]] bool is_bad(CellId c, const QualityBound& bound) const {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh_.points[mesh_.blocks[0].vertices[std::size_t{c} * (Dim + 1) + k]];
    return !meets(angle_range<Dim>(p), bound);
  }
  std::vector<VertexId> corners(const std::vector<CellId>& cells) const;
  void move_vertices(const std::vector<CellId>& bad);
  std::int64_t sweep(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start, const std::vector<VertexId>& candidates);
  void remesh();
  bool remesh_around(const std::vector<CellId>& bad);
  Vec<Dim> start_of(VertexId v) const {
    const auto at = std::ranges::lower_bound(start_, v, {}, &std::pair<VertexId, Vec<Dim>>::first);
    return at != start_.end() && at->first == v ? at->second : mesh_.points[v];
  }
  void remember(const std::vector<VertexId>& vertices, const std::vector<Vec<Dim>>& start);

  Mesh<Dim>& mesh_;
  const Field<Dim>& field_;
  Vec<Dim> box_;
  ImproveOptions options_;
  Execution& execution_;
  MoveLimits limits_;
  ImproveReport report_;
  std::vector<std::pair<VertexId, Vec<Dim>>> start_;  // where the vertices that have moved were at first, ascending
  std::vector<CellId> left_;                          // bad cells after the last step
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

template <int Dim>
Scan Improver<Dim>::scan_cells() const {
  const std::int64_t cells = mesh_.blocks[0].size();
  const QualityBound bound(options_.quality), list(options_.quality + kMargin);
  std::vector<Scan> part(static_cast<std::size_t>(block_count(cells, kBlock)));
  parallel_for(execution_, static_cast<std::int64_t>(part.size()), 1, [&](std::int64_t b) {
    Scan& scan = part[b];
    const VertexId* v = mesh_.blocks[0].cell(b * kBlock);
    for (std::int64_t c = b * kBlock; c < std::min(cells, (b + 1) * kBlock); ++c, v += Dim + 1) {
      std::array<Vec<Dim>, Dim + 1> p;
      for (int k = 0; k <= Dim; ++k) p[k] = mesh_.points[v[k]];
      const AngleRange r = angle_range<Dim>(p);
      scan.angles.merge(r);
      if (meets(r, list)) continue;
      scan.bad.push_back(static_cast<CellId>(c));
      scan.below += !meets(r, bound);
    }
  });
  Scan all;
  for (const Scan& scan : part) {
    all.bad.insert(all.bad.end(), scan.bad.begin(), scan.bad.end());
    all.angles.merge(scan.angles);
    all.below += scan.below;
  }
  return all;
}

template <int Dim>
std::vector<VertexId> Improver<Dim>::corners(const std::vector<CellId>& cells) const {
  std::vector<VertexId> found;
  found.reserve(cells.size() * (Dim + 1));
  for (const CellId c : cells) {
    const VertexId* v = mesh_.blocks[0].cell(c);
    found.insert(found.end(), v, v + Dim + 1);
  }
  parallel_sort(execution_, found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

template <int Dim>
void Improver<Dim>::remember(const std::vector<VertexId>& vertices, const std::vector<Vec<Dim>>& start) {
  std::vector<std::pair<VertexId, Vec<Dim>>> moved;
  for (std::size_t s = 0; s < vertices.size(); ++s)
    if (mesh_.points[vertices[s]] != start[s]) moved.push_back({vertices[s], start[s]});
  for (const auto& old : start_)
    if (!std::ranges::binary_search(vertices, old.first)) moved.push_back(old);
  std::ranges::sort(moved, {}, &std::pair<VertexId, Vec<Dim>>::first);
  start_ = std::move(moved);
}

/// Moves each candidate once, neighbours never at the same time: a vertex moves when its hash is the smallest among
/// the candidates around it that have not had their turn.
template <int Dim>
std::int64_t Improver<Dim>::sweep(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start,
                                  const std::vector<VertexId>& candidates) {
  std::vector<std::uint64_t> turn(patch.chosen().size(), 0);  // 0: no candidate, or done
  for (const VertexId v : candidates) turn[patch.slot(v)] = scramble(v) | 1;
  const auto first = [&](VertexId v, VertexId w) {
    const std::uint64_t a = turn[patch.slot(v)], b = patch.has_star(w) ? turn[patch.slot(w)] : 0;
    return b == 0 || a < b || (a == b && v <= w);
  };
  std::vector<VertexId> waiting = candidates, now;
  std::vector<std::uint8_t> state;
  std::int64_t moved = 0;
  while (!waiting.empty()) {
    const auto n = static_cast<std::int64_t>(waiting.size());
    state.assign(waiting.size(), 0);
    parallel_for(execution_, n, 64, [&](std::int64_t i) {
      for (const CellId c : patch.star(waiting[i]))
        for (const VertexId w : patch.cell(c))
          if (!first(waiting[i], w)) return;
      state[i] = 1;
    });
    parallel_for(execution_, n, 16, [&](std::int64_t i) {
      const VertexId v = waiting[i];
      if (state[i] == 0) return;
      Vec<Dim> x;
      if (!find_better_place(patch, v, field_, box_, limits_, false, start[patch.slot(v)], x)) return;
      patch.move(v, x);
      state[i] = 2;
    });
    now.clear();
    for (std::int64_t i = 0; i < n; ++i) {
      moved += state[i] == 2;
      if (state[i] == 0)
        now.push_back(waiting[i]);
      else
        turn[patch.slot(waiting[i])] = 0;
    }
    waiting.swap(now);
  }
  return moved;
}

template <int Dim>
void Improver<Dim>::move_vertices(const std::vector<CellId>& bad) {
  Patch<Dim> patch(mesh_, corners(bad), execution_);
  std::vector<Vec<Dim>> start(patch.chosen().size());
  for (std::size_t s = 0; s < start.size(); ++s) start[s] = patch.point(patch.chosen()[s]);
  std::vector<VertexId> candidates = patch.chosen();
  left_ = bad;
  const QualityBound list(options_.quality + kMargin);
  for (int round = 0; round < kSweeps && !left_.empty() && !late(); ++round) {
    const std::int64_t moved = sweep(patch, start, candidates);
    report_.moves += moved;
    if (moved == 0) break;
    // Cells that were touched and are bad now: those around the candidates.
    std::vector<CellId> cells;
    for (const VertexId v : candidates) {
      const auto star = patch.star(v);
      cells.insert(cells.end(), star.begin(), star.end());
    }
    parallel_sort(execution_, cells);
    cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
    std::vector<std::uint8_t> still(cells.size());
    parallel_for(execution_, static_cast<std::int64_t>(cells.size()), 1024,
                 [&](std::int64_t i) { still[i] = is_bad(cells[i], list); });
    left_.clear();
    for (std::size_t i = 0; i < cells.size(); ++i)
      if (still[i] != 0) left_.push_back(cells[i]);
    candidates = corners(left_);
    std::erase_if(candidates, [&](VertexId v) { return !patch.has_star(v); });
  }
  remember(patch.chosen(), start);
}

template <int Dim>
void Improver<Dim>::remesh() {
  while (!left_.empty()) {
    if (late()) {
      report_.stopped = ImproveStop::time_limit;
      return;
    }
    if (report_.passes >= options_.passes) {
      report_.stopped = ImproveStop::pass_limit;
      return;
    }
    ++report_.passes;
    if (!remesh_around(left_)) {
      report_.stopped = ImproveStop::no_progress;
      return;
    }
  }
}

template <int Dim>
bool Improver<Dim>::remesh_around(const std::vector<CellId>& bad) {
  // Stars of the corners of bad cells and of their neighbours.
  std::vector<VertexId> core = corners(bad), wide;
  {
    const Patch<Dim> patch(mesh_, core, execution_);
    for (const VertexId v : core)
      for (const CellId c : patch.star(v))
        for (const VertexId w : patch.cell(c)) wide.push_back(w);
  }
  parallel_sort(execution_, wide);
  wide.erase(std::unique(wide.begin(), wide.end()), wide.end());
  Patch<Dim> patch(mesh_, wide, execution_);
  std::vector<Vec<Dim>> start;
  for (const VertexId v : wide) start.push_back(start_of(v));
  Remesher<Dim> remesher(patch, std::move(start), field_, box_, limits_, report_);
  const bool progress = remesher.pass(options_.quality + kMargin, [&] { return late(); }) > 0;
  remember(patch.chosen(), remesher.start());
  for (const auto& [from, to] : patch.compact(execution_)) {
    const auto at = std::ranges::lower_bound(start_, from, {}, &std::pair<VertexId, Vec<Dim>>::first);
    if (at != start_.end() && at->first == from) start_.push_back({to, at->second});
  }
  std::ranges::stable_sort(start_, {}, &std::pair<VertexId, Vec<Dim>>::first);
  left_ = scan_cells().bad;
  return progress;
}

}  // namespace

std::string_view name_of(ImproveStop stop) {
  constexpr std::string_view kNames[] = {"off", "target met", "no progress", "pass limit", "time limit"};
  return kNames[static_cast<int>(stop)];
}

template <int Dim>
ImproveReport improve(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const ImproveOptions& options,
                      Execution& execution) {
  if (options.quality <= 0 || mesh.blocks.empty()) return {};
  return Improver<Dim>(mesh, field, box, options, execution).run();
}

template ImproveReport improve(Mesh<2>&, const Field<2>&, const Vec<2>&, const ImproveOptions&, Execution&);
template ImproveReport improve(Mesh<3>&, const Field<3>&, const Vec<3>&, const ImproveOptions&, Execution&);

}  // namespace treemarch
