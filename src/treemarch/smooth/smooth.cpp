#include "treemarch/smooth/smooth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/simplex_quality.h"
#include "treemarch/smooth/strata.h"

namespace treemarch {

namespace {

/// Moves shorter than this fraction of the distance to the first neighbour are left out: on a regular lattice that is
/// almost every one.
constexpr double kNegligible = 1e-3;

void check(const SmoothOptions& options) {
  const auto fail = [](const char* what) { throw Error(ErrorKind::usage, what); };
  if (options.steps < 0) fail("smooth: a negative number of steps; give 0 or more");
  if (!(options.lambda > 0 && options.lambda <= 1)) fail("lambda: not in (0, 1]; 0.33 is usual");
  if (options.smoother == Smoother::taubin && !(options.mu >= -1 && options.mu < -options.lambda)) {
    fail("mu: not in [-1, -lambda); -0.34 goes with a lambda of 0.33");
  }
  if (!(options.max_displacement >= 0)) fail("displacement: negative or no number; give a length");
}

/// Angles of a simplex if its vertex v were at x.
template <int Dim>
AngleRange cell_angles_with(const VertexId* cell, const Points<Dim>& points, VertexId v, const Vec<Dim>& x) {
  std::array<Vec<Dim>, Dim + 1> corners;
  for (int k = 0; k <= Dim; ++k) corners[k] = cell[k] == v ? x : points[cell[k]];
  return angle_range<Dim>(corners);
}

/// The angles of every cell.
template <int Dim>
std::vector<AngleRange> cell_angles(const Mesh<Dim>& mesh, const CellBlock& block, const Execution& execution) {
  std::vector<AngleRange> angles(static_cast<std::size_t>(block.size()));
  parallel_for(execution, block.size(), 2048, [&](std::int64_t c) {
    const VertexId v = block.cell(c)[0];
    angles[static_cast<std::size_t>(c)] = cell_angles_with<Dim>(block.cell(c), mesh.points, v, mesh.points[v]);
  });
  return angles;
}

/// For each vertex the worst angles of its cells.
template <int Dim>
std::vector<AngleRange> worst_angles_at(const Strata<Dim>& strata, std::size_t points,
                                        const std::vector<AngleRange>& of_cell, const Execution& execution) {
  std::vector<AngleRange> worst(points);
  parallel_for(execution, static_cast<std::int64_t>(points), 2048, [&](std::int64_t v) {
    for (const std::uint32_t c : strata.cells()[static_cast<VertexId>(v)]) {
      worst[static_cast<std::size_t>(v)].merge(of_cell[c]);
    }
  });
  return worst;
}

bool allows(const AngleRange& limit, const AngleRange& angles) {
  return !angles.inverted() && angles.high <= limit.high && angles.low >= limit.low;
}

/// Smooths one subset of the vertices.
template <int Dim>
class SubsetSmoother {
 public:
  /// \param angles of every cell; kept up to date
  SubsetSmoother(Mesh<Dim>& mesh, const Strata<Dim>& strata, SubsetGraph graph, double max_displacement,
                 std::vector<AngleRange>& angles, const Execution& execution)
      : points_(mesh.points),
        strata_(strata),
        graph_(std::move(graph)),
        max_displacement_(max_displacement),
        angles_(angles),
        execution_(execution),
        targets_(graph_.vertices.size()),
        limits_(graph_.vertices.size()),
        last_move_(points_.size(), 0),
        against_(graph_.vertices.size(), 0) {
    for (auto& refused : refused_) refused.resize(graph_.vertices.size(), 0);
    for (const VertexId v : graph_.vertices) start_.push_back(points_[v]);
    report_.vertices = static_cast<std::int64_t>(start_.size());
  }

  /// Lets the cells at a vertex become as bad as the worst one beside them is.
  /// \param worst_at of each vertex of the mesh: the worst angles of its cells
  void allow_worst_of_surroundings(const std::vector<AngleRange>& worst_at) {
    parallel_for(execution_, report_.vertices, 512, [&](std::int64_t i) {
      const VertexId v = graph_.vertices[static_cast<std::size_t>(i)];
      AngleRange& limit = limits_[static_cast<std::size_t>(i)];
      for (const std::uint32_t c : strata_.cells()[v]) {
        for (int k = 0; k <= Dim; ++k) limit.merge(worst_at[strata_.simplices().cell(c)[k]]);
      }
    });
  }

  /// One Jacobi sweep with a factor on the way to the mean. \param half 0 or 1, the same for the same factor
  void sweep(double factor, int half) {
    ++sweep_;
    parallel_for(execution_, report_.vertices, 512, [&](std::int64_t i) { aim(static_cast<std::size_t>(i), factor); });
    for (std::size_t colour = 0; colour + 1 < graph_.colours.size(); ++colour) {
      const std::uint32_t begin = graph_.colours[colour];
      const Moves moves = parallel_reduce(
          execution_, graph_.colours[colour + 1] - begin, 1, Moves{},
          [&](std::int64_t block, std::int64_t) { return move_block(begin + static_cast<std::size_t>(block), half); },
          [](const Moves& a, const Moves& b) {
            return Moves{a.made + b.made, a.refused + b.refused};
          });
      report_.moves += moves.made;
      report_.refused += moves.refused;
    }
  }

  [[nodiscard]] SmoothReport::Stage report() const {
    SmoothReport::Stage report = report_;
    for (std::size_t i = 0; i < start_.size(); ++i) {
      report.displacement = std::max(report.displacement, norm(points_[graph_.vertices[i]] - start_[i]));
    }
    return report;
  }

 private:
  struct Moves {
    std::int64_t made = 0, refused = 0;
  };
  using Cells = std::span<const std::uint32_t>;

  /// Where a vertex should go; where it is if that is hardly anywhere else.
  void aim(std::size_t i, double factor) {
    const VertexId v = graph_.vertices[i];
    const Vec<Dim>& x = points_[v];
    const auto neighbours = graph_.neighbours_of(i);
    Vec<Dim> mean{};
    for (const VertexId w : neighbours) mean = mean + points_[w];
    mean = (1.0 / static_cast<double>(neighbours.size())) * mean;
    Vec<Dim> target = x + factor * (mean - x);
    const double distance = norm(target - start_[i]);
    if (distance > max_displacement_) {
      // A little less than the limit, which thus holds after rounding too.
      target = start_[i] + (max_displacement_ / distance * (1 - 1e-12)) * (target - start_[i]);
    }
    const unsigned pinned = strata_.pinned(v);
    for (int d = 0; d < Dim; ++d) {
      if (pinned >> d & 1U) target[d] = x[d];
    }
    const double negligible = kNegligible * kNegligible * squared_norm(points_[neighbours[0]] - x);
    targets_[i] = squared_norm(target - x) <= negligible ? x : target;
  }

  /// Whether a vertex of the cells has moved since the start of a sweep.
  [[nodiscard]] bool moved_since(Cells cells, std::uint32_t sweep) const {
    for (const std::uint32_t c : cells) {
      const VertexId* cell = strata_.simplices().cell(c);
      for (int k = 0; k <= Dim; ++k) {
        if (last_move_[cell[k]] >= sweep) return true;
      }
    }
    return false;
  }

  [[nodiscard]] Moves move_block(std::size_t block, int half) {
    Moves sum;
    for (std::uint32_t i = graph_.blocks[block]; i < graph_.blocks[block + 1]; ++i) {
      move(graph_.by_block[i], refused_[static_cast<std::size_t>(half)], sum);
    }
    return sum;
  }

  /// \param refused the last sweep with this factor in which each vertex was refused; 0 if it never was
  void move(std::uint32_t i, std::vector<std::uint32_t>& refused, Moves& moves) {
    const VertexId v = graph_.vertices[i];
    const Vec<Dim> from = points_[v];
    const Vec<Dim> to = targets_[i];
    if (to == from) return;
    const Cells cells = strata_.cells()[v];
    if (refused[i] != 0 && !moved_since(cells, refused[i])) {  // it would be refused again
      ++moves.refused;
      return;
    }
    AngleRange limit = limits_[i];
    for (const std::uint32_t c : cells) limit.merge(angles_[c]);
    thread_local std::vector<AngleRange> after;
    after.resize(cells.size());
    // What stood against it last time, or against the whole way, often stands against it now, or against half of it.
    std::size_t first = against_[i];
    for (const double fraction : {1.0, 0.5, 0.25}) {
      const Vec<Dim> x = fraction == 1.0 ? to : from + fraction * (to - from);
      const std::size_t against = first_against(cells, first, v, x, limit, after);
      if (against == cells.size()) {
        points_[v] = x;
        last_move_[v] = sweep_;
        for (std::size_t k = 0; k < cells.size(); ++k) angles_[cells[k]] = after[k];
        ++moves.made;
        return;
      }
      first = against;
    }
    against_[i] = static_cast<std::uint16_t>(std::min<std::size_t>(first, 0xffff));
    refused[i] = sweep_;
    ++moves.refused;
  }

  /// Position of a cell whose angles would leave the limit with v at x, looked for from `first` on; cells.size() if
  /// there is none, and then `after` holds the angles of all.
  [[nodiscard]] std::size_t first_against(Cells cells, std::size_t first, VertexId v, const Vec<Dim>& x,
                                          const AngleRange& limit, std::vector<AngleRange>& after) const {
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const std::size_t at = k + first < cells.size() ? k + first : k + first - cells.size();
      after[at] = angles_of(cells[at], v, x);
      if (!allows(limit, after[at])) return at;
    }
    return cells.size();
  }

  [[nodiscard]] AngleRange angles_of(std::uint32_t c, VertexId v, const Vec<Dim>& x) const {
    return cell_angles_with<Dim>(strata_.simplices().cell(c), points_, v, x);
  }

  Points<Dim>& points_;
  const Strata<Dim>& strata_;
  SubsetGraph graph_;
  double max_displacement_;
  std::vector<AngleRange>& angles_;
  const Execution& execution_;
  std::vector<Vec<Dim>> start_, targets_;
  std::vector<AngleRange> limits_;
  std::uint32_t sweep_ = 0;                            ///< from 1
  std::vector<std::uint32_t> last_move_;               ///< per vertex of the mesh: the sweep in which it moved last
  std::array<std::vector<std::uint32_t>, 2> refused_;  ///< per half of a step
  std::vector<std::uint16_t> against_;                 ///< which of a vertex' cells refused it last
  SmoothReport::Stage report_;
};

}  // namespace

template <int Dim>
SmoothReport smooth(Mesh<Dim>& mesh, const SmoothOptions& options, Execution& execution) {
  check(options);
  const Execution::Stage stage(execution, "smooth");
  SmoothReport report;
  if (options.steps == 0 || mesh.points.empty()) return report;
  const Strata<Dim> strata(mesh, execution);
  std::vector<AngleRange> angles = cell_angles(mesh, strata.simplices(), execution);
  std::vector<AngleRange> worst_at = worst_angles_at(strata, mesh.points.size(), angles, execution);
  const auto smooth_subset = [&](Subset subset, double begin, double end) {
    SubsetSmoother<Dim> smoother(mesh, strata, strata.graph(subset, execution), options.max_displacement, angles,
                                 execution);
    if (subset != Subset::volume) smoother.allow_worst_of_surroundings(worst_at);
    const bool taubin = subset != Subset::volume && options.smoother == Smoother::taubin;
    for (int step = 0; step < options.steps; ++step) {
      smoother.sweep(options.lambda, 0);
      if (taubin) smoother.sweep(options.mu, 1);
      execution.progress(begin + (end - begin) * (step + 1) / options.steps);
    }
    return smoother.report();
  };
  report.curves = smooth_subset(Subset::curve, 0.1, 0.15);
  report.interfaces = smooth_subset(Subset::interface, 0.15, 0.6);
  worst_at = {};
  report.volume = smooth_subset(Subset::volume, 0.6, 1.0);
  return report;
}

template SmoothReport smooth<2>(Mesh<2>&, const SmoothOptions&, Execution&);
template SmoothReport smooth<3>(Mesh<3>&, const SmoothOptions&, Execution&);

}  // namespace treemarch
