#include "treemarch/improve/improve.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/improve/off_surface.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/remesh.h"
#include "treemarch/improve/stratum.h"
#include "treemarch/improve/sweep.h"
#include "treemarch/improve/vertex_mover.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 14;
constexpr double kMargin = 0.01;   // degrees: cells are listed up to this above the target
constexpr double kHeadroom = 0.5;  // degrees above the target at which a vertex is left alone
constexpr double kSlack = 0.1;     // of a voxel: how far a vertex may leave its interface
constexpr int kSweeps = 8;
constexpr int kPulls = 2;
constexpr float kOffSurface = 0.01F;  // difference of weights
constexpr int kWidths = 3;            // neighbourhoods that are tried, each a ring wider

struct Scan {
  std::vector<CellId> bad;  // up to kMargin above the target
  std::int64_t below = 0;
  double worst = 0;  // the target if nothing is below
};

template <int Dim>
class Improver {
 public:
  Improver(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const ImproveOptions& options,
           Execution& execution)
      : mesh_(mesh), field_(field), box_(box), options_(options), execution_(execution) {
    double voxel = field.spacing()[0];
    for (const double h : field.spacing()) voxel = std::min(voxel, h);
    limits_.displacement = options.max_displacement;
    if (options.max_displacement <= 0) {  // large cells need more room than a voxel offers
      limits_.displacement = 0.5 * voxel;
      limits_.inner_reach = 0.5;
      limits_.reach = 0.25;
    }
    limits_.slack = kSlack * voxel;
    limits_.goal = options.quality + kHeadroom;
  }

  ImproveReport run() {
    MaterialsAround around(options_.pull ? mesh_.points.size() : 0);
    const Scan scan = scan_cells(around);
    report_.below_before = scan.below;
    report_.worst_before = scan.worst;
    report_.stopped = ImproveStop::target_met;
    left_ = scan.bad;
    std::vector<VertexId> off;
    if (options_.pull && !field_.linear_along_edges())
      off = off_surface_vertices(mesh_.points, around, field_, kOffSurface, execution_);
    remesh(move_vertices(off));
    report_.worst_after = options_.quality;
    for (const CellId c : left_) {
      const double q = quality_of_cell(c);
      report_.below_after += q < options_.quality;
      report_.worst_after = std::min(report_.worst_after, q);
    }
    if (options_.keep_numbers) removed_.vertices.clear();
    compact(mesh_, std::move(removed_), execution_);
    return report_;
  }

 private:
  Scan scan_cells(MaterialsAround& around) const;
  [[nodiscard]] bool late() const {
    return options_.seconds > 0 &&
           std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count() > options_.seconds;
  }
  [[nodiscard]] double quality_of_cell(CellId c) const {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh_.points[mesh_.blocks[0].vertices[std::size_t{c} * (Dim + 1) + k]];
    return quality(angle_range<Dim>(p));
  }
  std::vector<VertexId> corners(const std::vector<CellId>& cells) const;
  std::vector<VertexId> with_neighbours(const Patch<Dim>& patch) const;
  std::vector<VertexId> move_vertices(const std::vector<VertexId>& off);
  void lift(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start);
  void remesh(std::vector<VertexId> around);
  void pull(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start, std::vector<VertexId> off);
  [[nodiscard]] double mean_edge(const Patch<Dim>& patch, VertexId v) const;
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
  Removed removed_;
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

template <int Dim>
Scan Improver<Dim>::scan_cells(MaterialsAround& around) const {
  const std::int64_t first = options_.first_cell, cells = mesh_.blocks[0].size();
  // A little more than the margin, so that rounding does not matter.
  const SquaredQualityBound list(QualityBound(options_.quality + 2 * kMargin));
  std::vector<std::vector<CellId>> part(static_cast<std::size_t>(block_count(cells - first, kBlock)));
  parallel_for(execution_, static_cast<std::int64_t>(part.size()), 1, [&](std::int64_t b) {
    const std::int64_t begin = first + b * kBlock;
    const VertexId* v = mesh_.blocks[0].cell(begin);
    for (std::int64_t c = begin; c < std::min(cells, begin + kBlock); ++c, v += Dim + 1) {
      std::array<Vec<Dim>, Dim + 1> p;
      for (int k = 0; k <= Dim; ++k) p[k] = mesh_.points[v[k]];
      if (!meets(p, list)) part[b].push_back(static_cast<CellId>(c));
      if (around.size() == 0) continue;
      for (int k = 0; k <= Dim; ++k) around.add(v[k], mesh_.blocks[0].materials[c]);
    }
  });
  Scan scan;
  scan.worst = options_.quality;
  for (const auto& some : part)
    for (const CellId c : some) {
      const double q = quality_of_cell(c);
      if (q < options_.quality + kMargin) scan.bad.push_back(c);
      scan.below += q < options_.quality;
      scan.worst = std::min(scan.worst, q);
    }
  return scan;
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

/// The corners of the bad cells and, where the patch has their stars, their neighbours.
template <int Dim>
std::vector<VertexId> Improver<Dim>::with_neighbours(const Patch<Dim>& patch) const {
  std::vector<VertexId> all;
  for (const VertexId v : corners(left_)) {
    all.push_back(v);
    if (!patch.has_star(v)) continue;
    for (const CellId c : patch.star(v))
      for (const VertexId w : patch.cell(c)) all.push_back(w);
  }
  parallel_sort(execution_, all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  return all;
}

/// Moves the corners of the bad cells and the vertices that are off their interface. \return the vertices that remesh()
/// needs.
template <int Dim>
std::vector<VertexId> Improver<Dim>::move_vertices(const std::vector<VertexId>& off) {
  std::vector<VertexId> chosen = corners(left_), all;
  std::ranges::set_union(chosen, off, std::back_inserter(all));
  Patch<Dim> patch(mesh_, std::move(all), execution_);
  patch.guard(options_.anchors);
  std::vector<Vec<Dim>> start(patch.chosen().size());
  for (std::size_t s = 0; s < start.size(); ++s) start[s] = patch.point(patch.chosen()[s]);
  lift(patch, start);
  pull(patch, start, off);
  remember(patch.chosen(), start);
  return with_neighbours(patch);
}

/// Sweeps over the corners of the bad cells.
template <int Dim>
void Improver<Dim>::lift(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start) {
  std::vector<VertexId> candidates = corners(left_);
  const QualityBound list(options_.quality + kMargin);
  for (int round = 0; round < kSweeps && !left_.empty() && !late(); ++round) {
    const Turns turns = turns_of(patch, candidates, execution_);
    const std::int64_t moved = sweep(patch, turns, execution_, [&](VertexId v, Vec<Dim>& x) {
      return find_better_place(patch, v, field_, box_, limits_, false, start[patch.slot(v)], x);
    });
    report_.moves += moved;
    if (moved == 0) break;
    // What is bad now was bad before or lies around a vertex that has moved.
    std::vector<CellId> cells;
    for (const VertexId v : candidates) {
      const auto star = patch.star(v);
      cells.insert(cells.end(), star.begin(), star.end());
    }
    parallel_sort(execution_, cells);
    cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
    std::vector<std::uint8_t> still(cells.size());
    parallel_for(execution_, static_cast<std::int64_t>(cells.size()), 1024,
                 [&](std::int64_t i) { still[i] = !meets(patch.angles(patch.cell(cells[i])), list); });
    left_.clear();
    for (std::size_t i = 0; i < cells.size(); ++i)
      if (still[i] != 0) left_.push_back(cells[i]);
    candidates = corners(left_);
    std::erase_if(candidates, [&](VertexId v) { return !patch.has_star(v); });
  }
}

/// Changes the connectivity around the bad cells, over wider and wider neighbourhoods.
template <int Dim>
void Improver<Dim>::remesh(std::vector<VertexId> around) {
  const double target = options_.quality + kMargin;
  const auto stop = [&] { return late(); };
  for (int width = 0; width < kWidths && !left_.empty(); ++width) {
    Patch<Dim> patch(mesh_, std::move(around), execution_);
    patch.guard(options_.anchors);
    std::vector<Vec<Dim>> start;
    for (const VertexId v : patch.chosen()) start.push_back(start_of(v));
    Remesher<Dim> remesher(patch, std::move(start), field_, box_, limits_, report_);
    report_.stopped = ImproveStop::no_progress;
    while (!left_.empty()) {
      if (report_.passes >= options_.passes) report_.stopped = ImproveStop::pass_limit;
      if (late()) report_.stopped = ImproveStop::time_limit;
      if (report_.stopped != ImproveStop::no_progress) break;
      ++report_.passes;
      const std::int64_t improved = remesher.pass(target, stop);
      left_ = remesher.bad_cells(target);
      if (improved == 0) break;
    }
    if (left_.empty()) report_.stopped = ImproveStop::target_met;
    remember(patch.chosen(), remesher.start());
    patch.list_removed(removed_);
    around = with_neighbours(patch);
    if (report_.stopped != ImproveStop::no_progress) break;
  }
}

/// Of the edges at a vertex, each as often as it has cells.
template <int Dim>
double Improver<Dim>::mean_edge(const Patch<Dim>& patch, VertexId v) const {
  double sum = 0;
  for (const CellId c : patch.star(v))
    for (const VertexId w : patch.cell(c)) sum += norm(patch.point(w) - patch.point(v));
  return sum / (static_cast<double>(patch.star(v).size()) * Dim);
}

/// Brings vertices back to their interface, never at the price of the target.
template <int Dim>
void Improver<Dim>::pull(Patch<Dim>& patch, const std::vector<Vec<Dim>>& start, std::vector<VertexId> off) {
  if (options_.longest_pulled > 0)
    std::erase_if(off, [&](VertexId v) { return mean_edge(patch, v) > options_.longest_pulled; });
  MoveLimits limits = limits_;
  limits.goal = options_.quality + kMargin;
  limits.slack *= 0.1;
  if (off.empty()) return;
  const Turns turns = turns_of(patch, off, execution_);
  for (int round = 0; round < kPulls && !late(); ++round)
    report_.pulls += sweep(patch, turns, execution_, [&](VertexId v, Vec<Dim>& x) {
      return find_nearer_place(patch, v, field_, box_, limits, start[patch.slot(v)], x);
    });
}

}  // namespace

std::string_view name_of(ImproveStop stop) {
  constexpr std::string_view kNames[] = {"off", "target met", "no progress", "pass limit", "time limit"};
  return kNames[static_cast<int>(stop)];
}

template <int Dim>
ImproveReport improve(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const ImproveOptions& options,
                      Execution& execution) {
  if (!(options.quality <= 60))
    throw Error(ErrorKind::usage, "--quality: must be at most 60 degrees, and 20 to 25 is what can be reached");
  if (options.quality <= 0 || mesh.blocks.empty() || mesh.blocks[0].type != kSimplex<Dim>) return {};
  return Improver<Dim>(mesh, field, box, options, execution).run();
}

template ImproveReport improve(Mesh<2>&, const Field<2>&, const Vec<2>&, const ImproveOptions&, Execution&);
template ImproveReport improve(Mesh<3>&, const Field<3>&, const Vec<3>&, const ImproveOptions&, Execution&);

}  // namespace treemarch
