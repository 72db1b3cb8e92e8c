#include "treemarch/smooth/smooth.h"

#include <algorithm>
#include <array>
#include <cmath>
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
AngleRange cell_angles_with(const VertexId* cell, const std::vector<Vec<Dim>>& points, VertexId v, const Vec<Dim>& x) {
  std::array<Vec<Dim>, Dim + 1> corners;
  for (int k = 0; k <= Dim; ++k) corners[k] = cell[k] == v ? x : points[cell[k]];
  return angle_range<Dim>(corners);
}

/// For each vertex the worst angles of its cells.
template <int Dim>
std::vector<AngleRange> worst_angles_at(const Mesh<Dim>& mesh, const Strata<Dim>& strata, const Execution& execution) {
  const CellBlock& block = strata.simplices();
  std::vector<AngleRange> of_cell(static_cast<std::size_t>(block.size()));
  parallel_for(execution, block.size(), 2048, [&](std::int64_t c) {
    const VertexId v = block.cell(c)[0];
    of_cell[static_cast<std::size_t>(c)] = cell_angles_with<Dim>(block.cell(c), mesh.points, v, mesh.points[v]);
  });
  std::vector<AngleRange> worst(mesh.points.size());
  parallel_for(execution, static_cast<std::int64_t>(worst.size()), 2048, [&](std::int64_t v) {
    for (const std::uint32_t c : strata.cells()[static_cast<VertexId>(v)]) {
      worst[static_cast<std::size_t>(v)].merge(of_cell[c]);
    }
  });
  return worst;
}

/// Smooths one subset of the vertices.
template <int Dim>
class SubsetSmoother {
 public:
  SubsetSmoother(Mesh<Dim>& mesh, const Strata<Dim>& strata, SubsetGraph graph, double max_displacement,
                 const Execution& execution)
      : points_(mesh.points),
        strata_(strata),
        graph_(std::move(graph)),
        max_displacement_(max_displacement),
        execution_(execution),
        targets_(graph_.vertices.size()),
        limits_(graph_.vertices.size()) {
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

  /// One Jacobi sweep with a factor on the way to the mean.
  void sweep(double factor) {
    parallel_for(execution_, report_.vertices, 512, [&](std::int64_t i) { aim(static_cast<std::size_t>(i), factor); });
    for (std::size_t colour = 0; colour + 1 < graph_.colours.size(); ++colour) {
      const std::uint32_t begin = graph_.colours[colour];
      const Moves moves = parallel_reduce(
          execution_, graph_.colours[colour + 1] - begin, 512, Moves{},
          [&](std::int64_t from, std::int64_t to) {
            Moves sum;
            for (std::int64_t i = from; i < to; ++i) move(graph_.by_colour[begin + static_cast<std::size_t>(i)], sum);
            return sum;
          },
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

  void move(std::uint32_t i, Moves& moves) {
    const VertexId v = graph_.vertices[i];
    const Vec<Dim> from = points_[v];
    const Vec<Dim> to = targets_[i];
    if (to == from) return;
    AngleRange limit = limits_[i];
    for (const std::uint32_t c : strata_.cells()[v]) limit.merge(angles_of(c, v, from));
    for (const double fraction : {1.0, 0.5, 0.25}) {
      const Vec<Dim> x = fraction == 1.0 ? to : from + fraction * (to - from);
      const bool allowed = std::ranges::all_of(strata_.cells()[v], [&](std::uint32_t c) {
        const AngleRange after = angles_of(c, v, x);
        return !after.inverted() && after.high <= limit.high && after.low >= limit.low;
      });
      if (!allowed) continue;
      points_[v] = x;
      ++moves.made;
      return;
    }
    ++moves.refused;
  }

  [[nodiscard]] AngleRange angles_of(std::uint32_t c, VertexId v, const Vec<Dim>& x) const {
    return cell_angles_with<Dim>(strata_.simplices().cell(c), points_, v, x);
  }

  std::vector<Vec<Dim>>& points_;
  const Strata<Dim>& strata_;
  SubsetGraph graph_;
  double max_displacement_;
  const Execution& execution_;
  std::vector<Vec<Dim>> start_, targets_;
  std::vector<AngleRange> limits_;
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
  std::vector<AngleRange> worst_at = worst_angles_at(mesh, strata, execution);
  const auto smooth_subset = [&](Subset subset, double begin, double end) {
    SubsetSmoother<Dim> smoother(mesh, strata, strata.graph(subset, execution), options.max_displacement, execution);
    if (subset != Subset::volume) smoother.allow_worst_of_surroundings(worst_at);
    const bool taubin = subset != Subset::volume && options.smoother == Smoother::taubin;
    for (int step = 0; step < options.steps; ++step) {
      smoother.sweep(options.lambda);
      if (taubin) smoother.sweep(options.mu);
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
