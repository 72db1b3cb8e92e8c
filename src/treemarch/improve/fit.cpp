#include "treemarch/improve/fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/core/solve.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/star_check.h"
#include "treemarch/improve/stratum.h"
#include "treemarch/improve/sweep.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1024;
constexpr int kMostParts = 6;  // samples along an edge
constexpr int kRounds = 2, kMostRounds = 4;
constexpr double kManyHeld = 0.05;  // of the vertices: so many that the limit of moves held back call for another round
constexpr double kStiffness = 0.02;  // of a vertex against moves that its facets do not ask for
// In voxels:
constexpr double kFine = 1.25;                 // shorter facets are true to the field if their corners are
constexpr double kSmooth = 1.2, kSharp = 4.2;  // facets up to the first follow the field, from the second on the voxels
constexpr double kLeast = 0.07;                // shorter moves are left out
constexpr double kMost = 0.7;                  // longer ones are along facets that hardly ask for them
template <int Dim>
constexpr double kPart = Dim == 2 ? 1 : 1.4;  // between samples, up to kMostParts of them

constexpr std::uint32_t kNone = 0xffffffffU;

template <int Dim>
struct Facet {
  std::array<VertexId, Dim> v;
  std::array<std::uint32_t, Dim> link;  ///< of the corner, kNone if it does not move
  MaterialId first, second;             ///< ascending
  bool flipped = false;                 ///< whether the normal of the corners in order is the one to `first`
};

/// A facet as it is measured.
template <int Dim>
struct Shape {
  MaterialId first, second;
  Vec<Dim> normal{};  ///< from first to second
  double voxel = 0;   ///< extent of a voxel along the normal
  double limit = 0;   ///< of the distances that are looked for
};

/// What the samples on a facet say to one of its corners. The interface is at distance t along the normal from a sample
/// with shares s_k of the corners; corners that move by d_k change it to t - sum_k s_k normal.d_k.
template <int Dim>
struct Link {
  std::array<float, Dim> normal{};
  std::array<float, Dim> coupling{};           ///< sum of s_0 s_k, the own corner first; times the area of a sample
  float pull = 0;                              ///< sum of t s_0
  std::array<std::uint32_t, Dim - 1> other{};  ///< places of the other corners, kNone if they do not move
};

Vec<2> area_normal(const std::array<Vec<2>, 2>& p) { return {p[1][1] - p[0][1], p[0][0] - p[1][0]}; }
Vec<3> area_normal(const std::array<Vec<3>, 3>& p) { return 0.5 * cross(p[1] - p[0], p[2] - p[0]); }

/// Points on a facet.
template <int Dim>
struct Samples {
  std::vector<std::array<double, Dim>> share;           ///< of each corner
  std::array<std::array<double, Dim>, Dim> coupling{};  ///< sum over all of products of the shares
};

/// At the centres of n (2D) or n^2 (3D) equal parts of a facet.
template <int Dim>
Samples<Dim> make_samples(int n) {
  Samples<Dim> all;
  if constexpr (Dim == 2) {
    for (int i = 0; i < n; ++i) all.share.push_back({1 - (i + 0.5) / n, (i + 0.5) / n});
  } else {
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j)
        for (const double third : {1.0 / 3, 2.0 / 3}) {
          const double a = (i + third) / n, b = (j + third) / n;
          if (a + b < 1) all.share.push_back({1 - a - b, a, b});
        }
  }
  for (const auto& share : all.share)
    for (int k = 0; k < Dim; ++k)
      for (int j = 0; j < Dim; ++j) all.coupling[k][j] += share[k] * share[j];
  return all;
}

template <int Dim>
class Fitter {
 public:
  Fitter(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const FitOptions& options, Execution& execution)
      : mesh_(mesh),
        field_(field),
        box_(box),
        options_(options),
        execution_(execution),
        target_(QualityBound(options.quality + 0.01)) {
    const auto [least, most] = std::ranges::minmax(field.spacing());
    voxel_ = least;
    largest_voxel_ = most;
    for (int n = 1; n <= kMostParts; ++n) samples_[n] = make_samples<Dim>(n);
  }

  FitReport run() {
    find_facets();
    if (facets_.empty()) return report_;
    Patch<Dim> patch(mesh_, std::move(chosen_), execution_);
    patch.guard(options_.anchors);
    link();
    gather_cells(patch);
    const Turns turns(order_, execution_, [&](std::int64_t i, const auto& add) {
      for (const auto& cell : cells_of(i))
        for (const VertexId w : cell)
          if (rank_[w] != kNone) add(rank_[w]);
    });
    report_.facets = static_cast<std::int64_t>(facets_.size());
    for (int round = 0; round < kRounds || (round < kMostRounds && held_back() > kManyHeld); ++round) {
      measure();
      if (round == 0) report_.rms_before = rms();
      report_.moves += sweep(turns, execution_, [&](std::uint32_t i) { return move(patch, i); });
    }
    report_.rms_after = rms();
    return report_;
  }

 private:
  void set_order(Facet<Dim>& f) const;
  [[nodiscard]] std::array<Vec<Dim>, Dim> corners(const Facet<Dim>& f) const {
    std::array<Vec<Dim>, Dim> p;
    for (int k = 0; k < Dim; ++k) p[k] = mesh_.points[f.v[k]];
    return p;
  }
  [[nodiscard]] RawVector<Facet<Dim>> interfaces() const;
  void find_facets();
  void sort_by_place();
  [[nodiscard]] double sharpness_of(double longest) const;
  [[nodiscard]] bool lies_on_box(const std::array<Vec<Dim>, Dim>& p) const;
  void link();
  void gather_cells(const Patch<Dim>& patch);
  [[nodiscard]] std::span<const std::array<VertexId, Dim>> cells_of(std::int64_t place) const {
    return std::span(cells_).subspan(first_cell_[place], first_cell_[place + 1] - first_cell_[place]);
  }
  [[nodiscard]] std::span<const Link<Dim>> links_of(std::int64_t place) const {
    return std::span(links_).subspan(first_link_[place], first_link_[place + 1] - first_link_[place]);
  }
  void measure();
  std::array<double, 2> measure(const Facet<Dim>& f);
  [[nodiscard]] double rms() const;
  bool to_field(const Shape<Dim>& f, const Vec<Dim>& x, double& t) const;
  bool to_voxels(const Shape<Dim>& f, const Vec<Dim>& x, double& t) const;
  [[nodiscard]] Vec<Dim> wish_of(std::int64_t place) const;
  bool move(Patch<Dim>& patch, std::uint32_t place);
  [[nodiscard]] double held_back() const;

  Mesh<Dim>& mesh_;
  const Field<Dim>& field_;
  Vec<Dim> box_;
  FitOptions options_;
  Execution& execution_;
  SquaredQualityBound target_;
  double voxel_ = 1, largest_voxel_ = 1;
  std::array<Samples<Dim>, kMostParts + 1> samples_;  // by parts of an edge
  std::vector<VertexId> chosen_, order_;              // ascending, and by their place in space
  std::vector<std::uint32_t> rank_;                   // place in order_ of each vertex of the mesh, or kNone
  std::vector<Facet<Dim>> facets_;
  std::array<double, 2> measured_{};  // area that the samples stand for, and sum of t^2
  // By places in order_:
  std::vector<std::size_t> first_link_, first_cell_;
  std::vector<Link<Dim>> links_;
  RawVector<std::array<VertexId, Dim>> cells_;  // around a vertex, without it
  std::vector<Vec<Dim>> moved_;                 // since measure()
  FitReport report_;
};

/// The longest edge, squared.
template <int Dim>
double longest_edge2(const std::array<Vec<Dim>, Dim>& p) {
  double longest = 0;
  for (int k = 0; k < Dim; ++k)
    for (int j = 0; j < k; ++j) longest = std::max(longest, squared_norm(p[k] - p[j]));
  return longest;
}

/// Sorts the corners and turns the normal from the smaller material to the larger one: the label values, by which
/// facets come, must not matter.
template <int Dim>
void Fitter<Dim>::set_order(Facet<Dim>& f) const {
  for (int k = 1; k < Dim; ++k)
    for (int j = k; j > 0 && f.v[j] < f.v[j - 1]; --j) {
      std::swap(f.v[j], f.v[j - 1]);
      f.flipped = !f.flipped;
    }
  if (f.second < f.first) {
    std::swap(f.first, f.second);
    f.flipped = !f.flipped;
  }
}

/// All facets of interfaces, by their vertices.
template <int Dim>
RawVector<Facet<Dim>> Fitter<Dim>::interfaces() const {
  Borders found;
  if (!options_.borders) found = find_borders(mesh_, execution_);
  const RawVector<SharedFacet>& facets = (options_.borders ? *options_.borders : found).facets;
  const auto material = [&](const FacetSide& s) { return mesh_.blocks[s.block].materials[s.cell]; };
  const auto add = [&](const SharedFacet& shared, std::vector<Facet<Dim>>& to) {
    const CellBlock& block = mesh_.blocks[shared.own.block];
    const LocalFacet& local = topology(block.type).facets[shared.own.facet];
    Facet<Dim> f;
    f.first = material(shared.own);
    f.second = shared.is_on_hull() ? options_.outside : material(shared.beyond);
    // Others than simplices are of cells that stay as they are.
    if (f.first == f.second || f.second == kOutside || local.size != Dim) return;
    for (int k = 0; k < Dim; ++k) f.v[k] = block.cell(static_cast<std::int64_t>(shared.own.cell))[local.vertex[k]];
    if (shared.is_on_hull() && lies_on_box(corners(f))) return;
    set_order(f);
    to.push_back(f);
  };
  std::vector<std::vector<Facet<Dim>>> parts(static_cast<std::size_t>(block_count(std::ssize(facets), kBlock)));
  parallel_for(execution_, std::ssize(parts), 1, [&](std::int64_t part) {
    for (std::int64_t i = part * kBlock; i < std::min(std::ssize(facets), (part + 1) * kBlock); ++i)
      add(facets[i], parts[part]);
  });
  return joined(execution_, parts);
}

/// The vertices whose facets are large on average, and all their facets.
template <int Dim>
void Fitter<Dim>::find_facets() {
  const RawVector<Facet<Dim>> all = interfaces();
  RawVector<float> above(all.size());  // length above the limit
  parallel_for(execution_, std::ssize(all), kBlock, [&](std::int64_t i) {
    above[i] = static_cast<float>(std::sqrt(longest_edge2<Dim>(corners(all[i]))) / voxel_ - kFine);
  });
  std::vector<float> excess(mesh_.points.size(), 0);
  for (std::size_t i = 0; i < all.size(); ++i)
    for (const VertexId v : all[i].v) excess[v] += above[i];
  for (std::size_t v = 0; v < excess.size(); ++v)
    if (excess[v] > 0) chosen_.push_back(static_cast<VertexId>(v));
  sort_by_place();

  rank_.assign(mesh_.points.size(), kNone);
  for (std::size_t i = 0; i < order_.size(); ++i) rank_[order_[i]] = static_cast<std::uint32_t>(i);
  // Where a facet goes: to the first of its vertices.
  std::vector<std::uint32_t> to(all.size()), next(order_.size() + 1, 0);
  parallel_for(execution_, std::ssize(all), kBlock, [&](std::int64_t i) {
    to[i] = kNone;
    for (const VertexId v : all[i].v) to[i] = std::min(to[i], rank_[v]);
  });
  for (const std::uint32_t first : to)
    if (first != kNone) ++next[first];
  facets_.resize(exclusive_scan(std::span(next)));
  for (std::uint32_t& first : to)
    if (first != kNone) first = next[first]++;
  parallel_for(execution_, std::ssize(all), kBlock, [&](std::int64_t i) {
    if (to[i] != kNone) facets_[to[i]] = all[i];
  });
}

/// Those near each other in space are near each other in the order.
template <int Dim>
void Fitter<Dim>::sort_by_place() {
  std::vector<std::pair<std::uint64_t, VertexId>> keyed(chosen_.size());
  const double cell = 2 * largest_voxel_;
  parallel_for(execution_, std::ssize(keyed), kBlock, [&](std::int64_t i) {
    std::uint64_t key = 0;
    for (int d = 0; d < Dim; ++d) {
      const auto c = static_cast<std::uint64_t>(std::clamp(mesh_.points[chosen_[i]][d] / cell, 0.0, 1048575.0));
      for (int bit = 0; bit < 20; ++bit) key |= (c >> bit & 1) << (bit * Dim + d);
    }
    keyed[i] = {key, chosen_[i]};
  });
  parallel_sort(execution_, keyed);
  for (const auto& [key, v] : keyed) order_.push_back(v);
}

template <int Dim>
bool Fitter<Dim>::lies_on_box(const std::array<Vec<Dim>, Dim>& p) const {
  unsigned axes = ~0U;
  for (const Vec<Dim>& x : p) {
    axes &= box_axes(x, box_);
    for (int d = 0; d < Dim; ++d)
      if (x[d] != p[0][d]) axes &= ~(1U << d);
  }
  return axes != 0;
}

template <int Dim>
void Fitter<Dim>::link() {
  first_link_.assign(order_.size() + 1, 0);
  for (const auto& f : facets_)
    for (const VertexId v : f.v)
      if (rank_[v] != kNone) ++first_link_[rank_[v]];
  links_.resize(exclusive_scan(std::span(first_link_)));
  if (links_.size() >= kNone)
    throw Error(ErrorKind::limits, "mesh: too many facets of interfaces; choose larger cells");
  std::vector<std::size_t> next = first_link_;
  for (auto& f : facets_)
    for (int k = 0; k < Dim; ++k) {
      const std::uint32_t place = rank_[f.v[k]];
      f.link[k] = place == kNone ? kNone : static_cast<std::uint32_t>(next[place]++);
      if (place == kNone) continue;
      for (int j = 1; j < Dim; ++j) links_[f.link[k]].other[j - 1] = rank_[f.v[(k + j) % Dim]];
    }
}

template <int Dim>
void Fitter<Dim>::gather_cells(const Patch<Dim>& patch) {
  first_cell_.assign(order_.size() + 1, 0);
  for (std::size_t i = 0; i < order_.size(); ++i) first_cell_[i] = patch.star(order_[i]).size();
  cells_.resize(exclusive_scan(std::span(first_cell_)));
  // The cells come by the numbers of vertices.
  const std::vector<VertexId>& chosen = patch.chosen();
  parallel_for(execution_, std::ssize(chosen), kBlock, [&](std::int64_t i) {
    auto to = cells_.begin() + static_cast<std::ptrdiff_t>(first_cell_[rank_[chosen[i]]]);
    for (const CellId c : patch.star(chosen[i])) *to++ = others_of<Dim>(patch.cell(c), chosen[i]);
  });
}

/// Distance to where the two materials weigh the same: along the slope if it is near, else by secants. Weights change
/// by about 1 over a voxel.
template <int Dim>
bool Fitter<Dim>::to_field(const Shape<Dim>& f, const Vec<Dim>& x, double& t) const {
  constexpr double kFlat = 0.8;  // differences above tell a side, but no distance
  constexpr double kNear = 0.5;  // voxels
  const auto [value, slope] = field_.difference_along(x, f.normal, f.first, f.second);
  if (std::abs(value) < kFlat && slope * f.voxel < -0.25 && std::abs(value) < -kNear * f.voxel * slope) {
    t = -value / slope;
    return true;
  }
  double low = 0, d_low = value;
  const double sign = d_low > 0 ? 1 : -1;
  double step = std::clamp(std::abs(d_low), 0.1, 0.9) * f.voxel;
  while (d_low != 0) {
    const double high = low + sign * step;
    if (std::abs(high) > f.limit) return false;
    const double d_high = field_.difference(x + high * f.normal, f.first, f.second);
    const bool crossed = d_high * sign <= 0;
    const bool steep = std::abs(d_low) < kFlat && std::abs(d_low - d_high) > 0.25 * step / f.voxel;
    if (crossed || steep) {
      t = low + (high - low) * d_low / (d_low - d_high);
      if (std::abs(t - high) < f.voxel) return std::abs(t) <= f.limit;
    }
    low = high;
    d_low = d_high;
    step = 0.7 * f.voxel;
  }
  return false;  // neither material is near
}

/// Distance to where the voxels of one material end and those of the other begin: from one voxel to the next.
template <int Dim>
bool Fitter<Dim>::to_voxels(const Shape<Dim>& f, const Vec<Dim>& x, double& t) const {
  const Bricks<Dim>& bricks = field_.bricks();
  const Vec<Dim>& h = field_.spacing();
  Coord<Dim> voxel, way;
  for (int d = 0; d < Dim; ++d)
    voxel[d] = static_cast<std::int32_t>(std::clamp(x[d] / h[d], 0.0, bricks.extent[d] - 1e-9));
  const MaterialId start = bricks.own(voxel);
  if (start != f.first && start != f.second) return false;
  const MaterialId other = start == f.first ? f.second : f.first;
  const double sign = start == f.first ? 1 : -1;
  Vec<Dim> next, period;  // distance to the next face, and between faces
  for (int d = 0; d < Dim; ++d) {
    const double rate = sign * f.normal[d];
    way[d] = rate > 0 ? 1 : -1;
    period[d] = rate == 0 ? std::numeric_limits<double>::infinity() : h[d] / std::abs(rate);
    next[d] = rate == 0 ? period[d] : ((rate > 0 ? voxel[d] + 1 : voxel[d]) * h[d] - x[d]) / rate;
  }
  while (true) {
    int axis = 0;
    for (int d = 1; d < Dim; ++d)
      if (next[d] < next[axis]) axis = d;
    const double here = next[axis];
    if (here > f.limit) return false;
    next[axis] += period[axis];
    voxel[axis] += way[axis];
    if (voxel[axis] < 0 || voxel[axis] >= bricks.extent[axis]) return false;
    const MaterialId m = bricks.own(voxel);
    if (m == start) continue;
    t = sign * here;
    return m == other;
  }
}

/// How much a facet follows the voxels, from 0 to 1. It averages over their staircase more the larger it is: the power
/// keeps the error of the normals of a ball about the same for all sizes (docs/stages/improve.md).
template <int Dim>
double Fitter<Dim>::sharpness_of(double longest) const {
  if (field_.kind() == FieldKind::grey) return 0;  // a thresholded grey value says less than the value itself
  const double part = std::clamp((longest / largest_voxel_ - kSmooth) / (kSharp - kSmooth), 0.0, 1.0);
  return part * std::sqrt(part);
}

/// Fills the links of a facet; returns the area that its samples stand for, and the sum of t^2.
template <int Dim>
std::array<double, 2> Fitter<Dim>::measure(const Facet<Dim>& f) {
  const std::array<Vec<Dim>, Dim> p = corners(f);
  const double longest = std::sqrt(longest_edge2<Dim>(p));
  Shape<Dim> shape{f.first, f.second, (f.flipped ? -1.0 : 1.0) * area_normal(p)};
  const double area = norm(shape.normal);
  shape.normal = (1 / area) * shape.normal;
  double per_voxel = 0;
  for (int d = 0; d < Dim; ++d) per_voxel += std::pow(shape.normal[d] / field_.spacing()[d], 2);
  shape.voxel = 1 / std::sqrt(per_voxel);
  shape.limit = std::max(1.5 * shape.voxel, 0.5 * longest);
  const double sharpness = sharpness_of(longest);
  const auto& samples =
      samples_[std::clamp(static_cast<int>(std::ceil(longest / (kPart<Dim> * voxel_))), 1, kMostParts)];
  double count = 0, squares = 0;
  std::array<double, Dim> pull{};
  auto coupling = samples.coupling;
  for (const auto& share : samples.share) {
    Vec<Dim> x{};
    for (int k = 0; k < Dim; ++k) x = x + share[k] * p[k];
    double smooth = 0, sharp = 0;
    if ((sharpness < 1 && !to_field(shape, x, smooth)) || (sharpness > 0 && !to_voxels(shape, x, sharp))) {
      for (int k = 0; k < Dim; ++k)
        for (int j = 0; j < Dim; ++j) coupling[k][j] -= share[k] * share[j];
      continue;
    }
    const double t = smooth + sharpness * (sharp - smooth);
    ++count;
    squares += t * t;
    for (int k = 0; k < Dim; ++k) pull[k] += t * share[k];
  }
  if (count == 0) coupling = {};
  const double weight = area / static_cast<double>(samples.share.size());
  for (int k = 0; k < Dim; ++k) {
    if (f.link[k] == kNone) continue;
    Link<Dim>& link = links_[f.link[k]];
    for (int d = 0; d < Dim; ++d) link.normal[d] = static_cast<float>(shape.normal[d]);
    for (int j = 0; j < Dim; ++j) link.coupling[j] = static_cast<float>(weight * coupling[k][(k + j) % Dim]);
    link.pull = static_cast<float>(weight * pull[k]);
  }
  return {weight * count, weight * squares};
}

template <int Dim>
void Fitter<Dim>::measure() {
  using Sums = std::array<double, 2>;
  measured_ = parallel_reduce(
      execution_, std::ssize(facets_), kBlock, Sums{},
      [&](std::int64_t begin, std::int64_t end) {
        Sums sums{};
        for (std::int64_t i = begin; i < end; ++i) {
          const Sums one = measure(facets_[static_cast<std::size_t>(i)]);
          sums[0] += one[0];
          sums[1] += one[1];
        }
        return sums;
      },
      [](const Sums& a, const Sums& b) {
        return Sums{a[0] + b[0], a[1] + b[1]};
      });
  moved_.assign(order_.size(), {});
}

/// A move along the normal.
template <int Dim>
double along(const Link<Dim>& link, const Vec<Dim>& x) {
  double sum = 0;
  for (int d = 0; d < Dim; ++d) sum += link.normal[d] * x[d];
  return sum;
}

/// Sum over the samples of s_0 sum_k s_k normal.d_k.
template <int Dim>
double pushed(const Link<Dim>& link, const Vec<Dim>& own, const std::vector<Vec<Dim>>& moved) {
  double sum = link.coupling[0] * along(link, own);
  for (int j = 1; j < Dim; ++j)
    if (link.other[j - 1] != kNone) sum += link.coupling[j] * along(link, moved[link.other[j - 1]]);
  return sum;
}

/// The distances of all samples, as the moves since measure() have changed them.
template <int Dim>
double Fitter<Dim>::rms() const {
  const double change =
      parallel_reduce(execution_, std::ssize(order_), kBlock, 0.0, [&](std::int64_t begin, std::int64_t end) {
        double sum = 0;
        for (std::int64_t i = begin; i < end; ++i)
          for (const Link<Dim>& link : links_of(i))
            sum += along(link, moved_[i]) * (pushed(link, moved_[i], moved_) - 2 * link.pull);
        return sum;
      });
  return measured_[0] > 0 ? std::sqrt(std::max(0.0, measured_[1] + change) / measured_[0]) : 0;
}

/// The move that fits the facets around a vertex best while its neighbours stay.
template <int Dim>
Vec<Dim> Fitter<Dim>::wish_of(std::int64_t place) const {
  std::array<Vec<Dim>, Dim> matrix{};
  Vec<Dim> wish{};
  const Vec<Dim>& own = moved_[place];
  for (const Link<Dim>& link : links_of(place)) {
    const double pull = link.pull - pushed(link, own, moved_);
    for (int a = 0; a < Dim; ++a) {
      wish[a] += pull * link.normal[a];
      const double part = link.coupling[0] * link.normal[a];
      for (int b = 0; b <= a; ++b) matrix[a][b] += part * link.normal[b];
    }
  }
  double trace = 0;
  for (int a = 0; a < Dim; ++a) {
    trace += matrix[a][a];
    for (int b = 0; b < a; ++b) matrix[b][a] = matrix[a][b];
  }
  if (trace == 0) return {};
  const unsigned fixed = box_axes(mesh_.points[order_[place]], box_);
  for (int a = 0; a < Dim; ++a) {
    matrix[a][a] += kStiffness * trace;
    if ((fixed >> a & 1) == 0) continue;
    for (int b = 0; b < Dim; ++b) matrix[a][b] = matrix[b][a] = 0;
    matrix[a][a] = 1;
    wish[a] = 0;
  }
  wish = solve_definite<Dim>(matrix, wish);
  const double length = norm(wish);
  if (length > kMost * largest_voxel_) wish = (kMost * largest_voxel_ / length) * wish;
  return wish;
}

template <int Dim>
bool Fitter<Dim>::move(Patch<Dim>& patch, std::uint32_t place) {
  const VertexId v = order_[place];
  const Vec<Dim> wish = wish_of(place), here = patch.point(v);
  if (squared_norm(wish) <= kLeast * kLeast * voxel_ * voxel_) return false;
  const unsigned fixed = box_axes(here, box_);
  thread_local StarCheck<Dim> cells;
  cells.gather(mesh_.points, cells_of(place));
  for (const double part : {1.0, 0.6, 0.3}) {
    Vec<Dim> x = here + part * wish;
    for (int a = 0; a < Dim; ++a)
      if ((fixed >> a & 1) != 0) x[a] = here[a];
    if (!cells.all_meet(x, target_)) continue;
    if (!options_.anchors.empty()) {
      auto [low, high] = cells.bounds();
      for (int a = 0; a < Dim; ++a) {  // on the hull a vertex may lie beyond all those around it
        low[a] = std::min({low[a], here[a], x[a]});
        high[a] = std::max({high[a], here[a], x[a]});
      }
      if (patch.has_anchors(low, high) && !patch.keeps_anchors(v, x)) return false;
    }
    patch.move(v, x);
    moved_[place] = moved_[place] + (x - here);
    return true;
  }
  return false;
}

/// The share of the vertices that moved as far as they may since measure().
template <int Dim>
double Fitter<Dim>::held_back() const {
  const double most = 0.99 * kMost * largest_voxel_;
  const auto held = std::ranges::count_if(moved_, [&](const Vec<Dim>& d) { return squared_norm(d) > most * most; });
  return static_cast<double>(held) / static_cast<double>(moved_.size());
}

}  // namespace

template <int Dim>
FitReport fit_interfaces(Mesh<Dim>& mesh, const Field<Dim>& field, const Vec<Dim>& box, const FitOptions& options,
                         Execution& execution) {
  if (mesh.blocks.empty() || mesh.blocks[0].type != kSimplex<Dim> || options.quality <= 0 || field.linear_along_edges())
    return {};
  return Fitter<Dim>(mesh, field, box, options, execution).run();
}

template FitReport fit_interfaces(Mesh<2>&, const Field<2>&, const Vec<2>&, const FitOptions&, Execution&);
template FitReport fit_interfaces(Mesh<3>&, const Field<3>&, const Vec<3>&, const FitOptions&, Execution&);

}  // namespace treemarch
