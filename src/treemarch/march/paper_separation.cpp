#include "treemarch/march/paper_separation.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/paper_split.h"
#include "treemarch/march/solid_angle.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {

namespace {

/// Sign of a vertex all of whose cells lie on one side: theirs.
constexpr std::int8_t kOneSided = 2;
/// Material of a cell that was lost and has no new one yet.
constexpr MaterialId kUndecided = kOutside - 1;
/// Determinant over the longest edge to the power of the dimension: no cut may make a piece flatter than this, so that
/// every piece is positive beyond rounding.
constexpr double kFlat = 1e-6;
/// Quality (mesh/simplex_quality.h) below which snapping may not bring a cell, unless the vertex had a worse one.
constexpr double kFairAngle = 10;
/// The least |f - 1/2| at a vertex of one material under a field: no cut comes nearer to it than 1/5 of an edge, even
/// where a smooth field would have the surface beyond it.
constexpr double kLeastOneSided = 0.125;

template <int Dim>
double shape(const std::array<Vec<Dim>, Dim + 1>& x) {
  double longest = 0;
  for (int a = 0; a < Dim; ++a) {
    for (int b = a + 1; b <= Dim; ++b) longest = std::max(longest, squared_norm(x[b] - x[a]));
  }
  std::array<Vec<Dim>, Dim> edges;
  for (int i = 0; i < Dim; ++i) edges[i] = x[i + 1] - x[0];
  const double scale = Dim == 2 ? longest : Dim == 3 ? longest * std::sqrt(longest) : longest * longest;
  return determinant<Dim>(edges) / scale;
}

/// Length of a segment, area of a triangle, volume of a tetrahedron.
template <int Dim>
double facet_area(const std::array<Vec<Dim>, Dim + 1>& x, int opposite) {
  if constexpr (Dim == 2) {
    return norm(x[(opposite + 2) % 3] - x[(opposite + 1) % 3]);
  } else if constexpr (Dim == 4) {
    return norm(inward_normals<4>(x)[opposite]) / 6;
  } else {
    const Vec<3>& o = x[(opposite + 1) % 4];
    return norm(cross(x[(opposite + 2) % 4] - o, x[(opposite + 3) % 4] - o)) / 2;
  }
}

template <int Dim>
std::array<Vec<Dim>, Dim + 1> corners_of(const std::array<VertexId, Dim + 1>& cell, const Points<Dim>& points) {
  std::array<Vec<Dim>, Dim + 1> x;
  for (int k = 0; k <= Dim; ++k) x[k] = points[cell[k]];
  return x;
}

template <int Dim>
Vec<Dim> between(const Vec<Dim>& a, const Vec<Dim>& b, double t) {
  return a + t * (b - a);  // in this form coordinates that both share stay exact: the hull
}

/// The corners in the order of their vertex ids, and whether that is an odd permutation.
template <int Dim>
std::pair<std::array<int, Dim + 1>, bool> order_of(const std::array<VertexId, Dim + 1>& cell) {
  std::array<int, Dim + 1> order;
  std::iota(order.begin(), order.end(), 0);
  bool odd = false;
  for (int i = 1; i <= Dim; ++i) {
    for (int j = i; j > 0 && cell[order[j]] < cell[order[j - 1]]; --j) {
      std::swap(order[j], order[j - 1]);
      odd = !odd;
    }
  }
  return {order, odd};
}

constexpr std::uint64_t edge_key(VertexId a, VertexId b) {
  return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
}

}  // namespace

template <int Dim>
PaperSeparation<Dim>::PaperSeparation(ActiveCells<Dim>& cells, Points<Dim>& points, std::size_t materials,
                                      const PaperMarchOptions<Dim>& options, Execution& execution)
    : cells_(cells),
      points_(points),
      options_(options),
      execution_(execution),
      separated_(materials, 0),
      sign_(points.size(), kOneSided),
      offset_(points.size(), 0.0),
      in_region_(cells.size(), 0) {
  low_ = high_ = points.empty() ? Vec<Dim>{} : points[0];
  for (const Vec<Dim>& x : points) {
    for (int d = 0; d < Dim; ++d) {
      low_[d] = std::min(low_[d], x[d]);
      high_[d] = std::max(high_[d], x[d]);
    }
  }
}

template <int Dim>
std::vector<typename PaperSeparation<Dim>::Index> PaperSeparation<Dim>::separate(MaterialId material,
                                                                                 std::span<const VertexId> candidates,
                                                                                 PaperMarchReport& report) {
  material_ = material;
  changed_.clear();
  find_vertices(candidates);
  find_region();
  evaluate();
  if (options_.snap > 0) report.snapped += snap();
  report.kept += keep_flat();
  number_cuts();
  report.cuts += static_cast<std::int64_t>(cut_keys_.size());
  report.split_cells += static_cast<std::int64_t>(cut_cells_.size());
  apply(report);
  assign_lost(report);
  for (const VertexId v : vertices_) sign_[v] = kOneSided;
  separated_[material] = 1;
  std::ranges::sort(changed_);
  return std::move(changed_);
}

template <int Dim>
void PaperSeparation<Dim>::find_vertices(std::span<const VertexId> candidates) {
  std::vector<std::uint8_t> two_sided(candidates.size(), 0);
  parallel_for(execution_, static_cast<std::int64_t>(candidates.size()), 256, [&](std::int64_t i) {
    bool inside = false;
    bool outside = false;
    cells_.for_each_cell(candidates[static_cast<std::size_t>(i)],
                         [&](Index c, int) { (cells_.material(c) == material_ ? inside : outside) = true; });
    two_sided[static_cast<std::size_t>(i)] = inside && outside;
  });
  vertices_.clear();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (two_sided[i]) vertices_.push_back(candidates[i]);
  }
}

template <int Dim>
void PaperSeparation<Dim>::find_region() {
  region_.clear();
  in_region_.resize(cells_.size(), 0);
  for (const VertexId v : vertices_) {
    cells_.for_each_cell(v, [&](Index c, int) {
      if (!in_region_[c]) region_.push_back(c);
      in_region_[c] = 1;
    });
  }
  for (const Index c : region_) in_region_[c] = 0;
  parallel_sort(execution_, region_);
}

/// f - 1/2 and its sign at all vertices that touch both sides; under a field, f at the others of the region too.
template <int Dim>
void PaperSeparation<Dim>::evaluate() {
  const auto n = static_cast<std::int64_t>(vertices_.size());
  if (options_.field) evaluate_field(vertices_);
  parallel_for_ranges(execution_, n, 64, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      if constexpr (Dim < 4)
        if (!options_.field) evaluate_solid_angles(static_cast<std::size_t>(i));
      const VertexId v = vertices_[static_cast<std::size_t>(i)];
      if (!options_.revisit && on_earlier_surface(v)) offset_[v] = 0;
      sign_[v] = static_cast<std::int8_t>((offset_[v] > options_.tolerance) - (offset_[v] < -options_.tolerance));
    }
  });
  if (options_.field) evaluate_field(one_sided_vertices());
}

/// f - 1/2 by position at some vertices.
template <int Dim>
void PaperSeparation<Dim>::evaluate_field(std::span<const VertexId> vertices) {
  parallel_for_ranges(
      execution_, static_cast<std::int64_t>(vertices.size()), 64, [&](std::int64_t begin, std::int64_t end) {
        const auto part = vertices.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
        Points<Dim> points;
        points.reserve(part.size());
        for (const VertexId v : part) points.push_back(points_[v]);
        std::vector<double> values(points.size());
        options_.field(material_, points, values);
        for (std::size_t i = 0; i < values.size(); ++i) offset_[part[i]] = values[i] - 0.5;
      });
}

/// The vertices of the region that touch one side only, ascending.
template <int Dim>
std::vector<VertexId> PaperSeparation<Dim>::one_sided_vertices() const {
  std::vector<VertexId> vertices;
  for (const Index c : region_) {
    for (const VertexId v : cells_.cell(c)) {
      if (sign_[v] == kOneSided) vertices.push_back(v);
    }
  }
  parallel_sort(execution_, vertices);
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

template <int Dim>
void PaperSeparation<Dim>::evaluate_solid_angles(std::size_t i) {
  if constexpr (Dim < 4) {
    double inside = 0;
    double all = 0;
    cells_.for_each_cell(vertices_[i], [&](Index c, int corner) {
      const double ratio = solid_angle_ratio<Dim>(kSimplex<Dim>, cells_.cell(c).data(), corner, points_);
      all += ratio;
      if (cells_.material(c) == material_) inside += ratio;
    });
    offset_[vertices_[i]] = inside / all - 0.5;
  }
}

/// Whether a vertex touches the material and just one other, which was separated before.
template <int Dim>
bool PaperSeparation<Dim>::on_earlier_surface(VertexId v) const {
  MaterialId other = kOutside;
  bool only = true;
  cells_.for_each_cell(v, [&](Index c, int) {
    const MaterialId m = cells_.material(c);
    if (m == material_ || m == other) return;
    only = only && other == kOutside;
    other = m;
  });
  return only && separated_[other] != 0;
}

template <int Dim>
std::int8_t PaperSeparation<Dim>::sign(Index c, int corner) const {
  const std::int8_t s = sign_[cells_.cell(c)[corner]];
  if (s != kOneSided) return s;
  return cells_.material(c) == material_ ? 1 : -1;
}

template <int Dim>
double PaperSeparation<Dim>::offset(Index c, int corner) const {
  const VertexId v = cells_.cell(c)[corner];
  if (sign_[v] != kOneSided) return offset_[v];
  const int side = cells_.material(c) == material_ ? 1 : -1;
  return side * (options_.field ? std::max(side * offset_[v], kLeastOneSided) : 0.5);
}

template <int Dim>
typename PaperSeparation<Dim>::Signs PaperSeparation<Dim>::signs(Index c) const {
  Signs s;
  for (int k = 0; k <= Dim; ++k) s[k] = sign(c, k);
  return s;
}

template <int Dim>
bool PaperSeparation<Dim>::is_cut(const Signs& s) {
  return std::ranges::count(s, 1) != 0 && std::ranges::count(s, -1) != 0;
}

/// The faces of the bounding box on which a vertex lies, one bit each.
template <int Dim>
unsigned PaperSeparation<Dim>::stratum(VertexId v) const {
  unsigned faces = 0;
  for (int d = 0; d < Dim; ++d) {
    faces |= static_cast<unsigned>(points_[v][d] == low_[d]) << (2 * d);
    faces |= static_cast<unsigned>(points_[v][d] == high_[d]) << (2 * d + 1);
  }
  return faces;
}

/// The nearest crossing along the edges of a vertex that keep it on its faces of the box; t is infinite without one.
template <int Dim>
typename PaperSeparation<Dim>::Crossing PaperSeparation<Dim>::nearest_crossing(VertexId v) const {
  Crossing best{std::numeric_limits<double>::infinity(), v, v};
  const unsigned own = stratum(v);
  cells_.for_each_cell(v, [&](Index c, int corner) {
    for (int k = 0; k <= Dim; ++k) {
      if (sign(c, k) * sign_[v] >= 0) continue;
      const VertexId w = cells_.cell(c)[k];
      const double t = offset_[v] / (offset_[v] - offset(c, k));
      if (std::pair(t, w) < std::pair(best.t, best.other) && (own & ~stratum(w)) == 0) best = {t, v, w};
    }
    static_cast<void>(corner);
  });
  return best;
}

/// Moves a vertex if no cell at it turns out worse than fair or than the worst one there was.
template <int Dim>
bool PaperSeparation<Dim>::move(VertexId v, const Vec<Dim>& to) {
  static const QualityBound fair(kFairAngle);
  AngleRange before;
  AngleRange after;
  cells_.for_each_cell(v, [&](Index c, int corner) {
    auto x = corners_of<Dim>(cells_.cell(c), points_);
    before.merge(angle_range<Dim>(x));
    x[corner] = to;
    after.merge(angle_range<Dim>(x));
  });
  if (after.inverted() || after.high > std::max(before.high, fair.high) || after.low < std::min(before.low, fair.low)) {
    return false;
  }
  points_[v] = to;
  return true;
}

/// Moves vertices onto the surface, the nearest first, and returns their number. In series, since every move changes
/// what its neighbours may do; the order depends on values and ids alone.
template <int Dim>
std::int64_t PaperSeparation<Dim>::snap() {
  std::vector<Crossing> crossings(vertices_.size());
  parallel_for(execution_, static_cast<std::int64_t>(vertices_.size()), 64, [&](std::int64_t i) {
    const VertexId v = vertices_[static_cast<std::size_t>(i)];
    crossings[static_cast<std::size_t>(i)] = sign_[v] == 0 ? Crossing{1, v, v} : nearest_crossing(v);
  });
  std::erase_if(crossings, [&](const Crossing& c) { return !(c.t < options_.snap); });
  parallel_sort(execution_, crossings, [](const Crossing& a, const Crossing& b) {
    return std::pair(a.t, a.vertex) < std::pair(b.t, b.vertex);
  });
  std::int64_t moved = 0;
  for (const Crossing& planned : crossings) {
    const Crossing now = nearest_crossing(planned.vertex);  // the other end may lie on the surface by now
    if (!(now.t < options_.snap)) continue;
    if (!move(now.vertex, between(points_[now.vertex], points_[now.other], now.t))) continue;
    sign_[now.vertex] = 0;
    ++moved;
  }
  return moved;
}

template <int Dim>
Vec<Dim> PaperSeparation<Dim>::cut_point(Index c, int a, int b) const {
  const Cell& cell = cells_.cell(c);
  if (cell[a] > cell[b]) std::swap(a, b);  // the same bits from every cell at the edge
  const double fa = offset(c, a);
  return between(points_[cell[a]], points_[cell[b]], fa / (fa - offset(c, b)));
}

/// If a piece of the cell would be flat: the vertex nearest to the surface, which then counts as on it; else kNone.
template <int Dim>
VertexId PaperSeparation<Dim>::flat_vertex(Index c) const {
  const Signs s = signs(c);
  if (!is_cut(s)) return ActiveCells<Dim>::kNone;
  const auto [order, odd] = order_of<Dim>(cells_.cell(c));
  Signs sorted;
  for (int i = 0; i <= Dim; ++i) sorted[i] = s[order[i]];
  constexpr auto kEnds = edge_ends<Dim>();
  std::array<Vec<Dim>, Dim + 1 + kEnds.size()> x;
  Crossing nearest{std::numeric_limits<double>::infinity(), 0, 0};
  const auto offer = [&](int k, int other) {
    const VertexId v = cells_.cell(c)[k];
    if (sign_[v] == kOneSided) return;
    const double t = offset(c, k) / (offset(c, k) - offset(c, other));
    if (std::pair(t, v) < std::pair(nearest.t, nearest.vertex)) nearest = {t, v, v};
  };
  for (int i = 0; i <= Dim; ++i) x[i] = points_[cells_.cell(c)[order[i]]];
  for (std::size_t e = 0; e < kEnds.size(); ++e) {
    const int a = order[kEnds[e][0]];
    const int b = order[kEnds[e][1]];
    if (s[a] * s[b] >= 0) continue;
    x[Dim + 1 + e] = cut_point(c, a, b);
    offer(a, b);
    offer(b, a);
  }
  for (const auto& piece : simplex_split<Dim>(sorted)) {
    std::array<Vec<Dim>, Dim + 1> corners;
    for (int k = 0; k <= Dim; ++k) corners[k] = x[piece.corners[k]];
    if (odd) std::swap(corners[Dim - 1], corners[Dim]);
    if (shape<Dim>(corners) < kFlat) return nearest.vertex;
  }
  return ActiveCells<Dim>::kNone;
}

/// Takes vertices as on the surface, unmoved, until no piece is flat; finds cut_cells_. Every round decides on the same
/// state in all cells. A vertex of one side is never taken: its end of a cut edge is the farther one.
template <int Dim>
std::int64_t PaperSeparation<Dim>::keep_flat() {
  std::int64_t kept = 0;
  std::vector<Index> work = region_;
  while (!work.empty()) {
    std::vector<VertexId> flat(work.size());
    parallel_for(execution_, static_cast<std::int64_t>(work.size()), 256, [&](std::int64_t i) {
      flat[static_cast<std::size_t>(i)] = flat_vertex(work[static_cast<std::size_t>(i)]);
    });
    std::ranges::sort(flat);
    flat.erase(std::ranges::lower_bound(flat, VertexId{ActiveCells<Dim>::kNone}), flat.end());
    flat.erase(std::unique(flat.begin(), flat.end()), flat.end());
    work.clear();
    for (const VertexId v : flat) {
      sign_[v] = 0;
      cells_.for_each_cell(v, [&](Index c, int) { work.push_back(c); });
    }
    kept += static_cast<std::int64_t>(flat.size());
  }
  cut_cells_.clear();
  for (const Index c : region_) {
    if (is_cut(signs(c))) cut_cells_.push_back(c);
  }
  return kept;
}

/// Numbers the cut edges and places their vertices.
template <int Dim>
void PaperSeparation<Dim>::number_cuts() {
  struct Cut {
    std::uint64_t key;
    Index cell;
    std::uint8_t a, b;
    bool operator<(const Cut& other) const { return std::tie(key, cell) < std::tie(other.key, other.cell); }
  };
  std::vector<Cut> cuts;
  for (const Index c : cut_cells_) {
    const Cell& cell = cells_.cell(c);
    for (const auto& [a, b] : edge_ends<Dim>()) {
      if (sign(c, a) * sign(c, b) < 0) cuts.push_back({edge_key(cell[a], cell[b]), c, a, b});
    }
  }
  parallel_sort(execution_, cuts);
  cuts.erase(std::unique(cuts.begin(), cuts.end(), [](const Cut& x, const Cut& y) { return x.key == y.key; }),
             cuts.end());
  if (points_.size() + cuts.size() >= ActiveCells<Dim>::kNone) {
    throw Error(ErrorKind::limits, "march: more than 2^32 - 2 vertices; choose larger cells");
  }
  first_cut_ = static_cast<VertexId>(points_.size());
  cut_keys_.resize(cuts.size());
  points_.resize(points_.size() + cuts.size());
  parallel_for(execution_, static_cast<std::int64_t>(cuts.size()), 1024, [&](std::int64_t i) {
    const Cut& cut = cuts[static_cast<std::size_t>(i)];
    cut_keys_[static_cast<std::size_t>(i)] = cut.key;
    points_[first_cut_ + static_cast<std::size_t>(i)] = cut_point(cut.cell, cut.a, cut.b);
  });
  cells_.add_vertices(cuts.size());
  sign_.resize(points_.size(), kOneSided);
  offset_.resize(points_.size(), 0.0);
}

template <int Dim>
VertexId PaperSeparation<Dim>::cut_vertex(VertexId a, VertexId b) const {
  const auto at = std::ranges::lower_bound(cut_keys_, edge_key(a, b));
  return first_cut_ + static_cast<VertexId>(at - cut_keys_.begin());
}

/// Splits the cut cells and gives their side to the others of the region.
template <int Dim>
void PaperSeparation<Dim>::apply(PaperMarchReport& report) {
  lost_.clear();
  lost_cells_.clear();
  for (const Index c : region_) {
    const Signs s = signs(c);
    const bool inside = cells_.material(c) == material_;
    const bool positive = std::ranges::count(s, 1) != 0;
    const bool negative = std::ranges::count(s, -1) != 0;
    if (positive && negative) {
      split_cell(c);
    } else if (positive && !inside) {
      cells_.set_material(c, material_);
      changed_.push_back(c);
    } else if (negative && inside) {
      lost_.push_back({static_cast<std::uint32_t>(lost_cells_.size()), 1});
      lost_cells_.push_back(c);
      cells_.set_material(c, kUndecided);
    }
  }
  report.reassigned += static_cast<std::int64_t>(lost_.size());
}

template <int Dim>
void PaperSeparation<Dim>::split_cell(Index c) {
  const Cell cell = cells_.cell(c);
  const MaterialId own = cells_.material(c);
  const auto [order, odd] = order_of<Dim>(cell);
  Signs sorted;
  for (int i = 0; i <= Dim; ++i) sorted[i] = sign(c, order[i]);
  constexpr auto kEnds = edge_ends<Dim>();
  Cell ordered;
  for (int i = 0; i <= Dim; ++i) ordered[i] = cell[order[i]];
  const auto vertex = [&](std::uint8_t corner) {
    if (corner <= Dim) return ordered[corner];
    const auto [a, b] = kEnds[corner - Dim - 1];
    return cut_vertex(ordered[a], ordered[b]);
  };
  std::array<Cell, SimplexSplit<Dim>::kMaxPieces> pieces;
  std::array<MaterialId, SimplexSplit<Dim>::kMaxPieces> materials;
  std::size_t n = 0;
  for (const auto& piece : simplex_split<Dim>(sorted)) {
    for (int k = 0; k <= Dim; ++k) pieces[n][k] = vertex(piece.corners[k]);
    if (odd) std::swap(pieces[n][Dim - 1], pieces[n][Dim]);
    materials[n++] = piece.side > 0 ? material_ : own == material_ ? kUndecided : own;
  }
  const Index first_new = cells_.size();
  cells_.replace(c, std::span(pieces.data(), n), std::span(materials.data(), n));
  const auto first_lost = static_cast<std::uint32_t>(lost_cells_.size());
  for (std::size_t i = 0; i < n; ++i) {
    const Index piece = i == 0 ? c : first_new + static_cast<Index>(i) - 1;
    (materials[i] == kUndecided ? lost_cells_ : changed_).push_back(piece);
  }
  const auto lost = static_cast<std::uint32_t>(lost_cells_.size()) - first_lost;
  if (lost > 0) lost_.push_back({first_lost, lost});
}

/// The material other than the separated one with the largest facet area around a part; kUndecided without one.
template <int Dim>
MaterialId PaperSeparation<Dim>::majority(const LostPart& part) const {
  std::vector<std::pair<MaterialId, double>> areas;
  for (std::uint32_t i = part.first; i < part.first + part.count; ++i) {
    const Index c = lost_cells_[i];
    for (int k = 0; k <= Dim; ++k) {
      const Index other = cells_.neighbour(c, k);
      if (other == ActiveCells<Dim>::kNone) continue;
      const MaterialId material = cells_.material(other);
      if (material != material_ && material != kUndecided) {
        areas.emplace_back(material, facet_area<Dim>(corners_of<Dim>(cells_.cell(c), points_), k));
      }
    }
  }
  std::ranges::sort(areas);
  MaterialId best = kUndecided;
  double largest = 0;
  for (std::size_t i = 0; i < areas.size();) {
    const MaterialId material = areas[i].first;
    double sum = 0;
    for (; i < areas.size() && areas[i].first == material; ++i) sum += areas[i].second;
    if (sum > largest) {
      largest = sum;
      best = material;
    }
  }
  return best;
}

/// Gives the lost parts to their neighbours, round by round from the outside in. Parts that no other material reaches
/// across a facet stay with the separated one.
template <int Dim>
void PaperSeparation<Dim>::assign_lost(PaperMarchReport& report) {
  std::vector<LostPart> open = std::move(lost_);
  while (!open.empty()) {
    std::vector<MaterialId> chosen(open.size());
    parallel_for(execution_, static_cast<std::int64_t>(open.size()), 64, [&](std::int64_t i) {
      chosen[static_cast<std::size_t>(i)] = majority(open[static_cast<std::size_t>(i)]);
    });
    const bool stuck = std::ranges::all_of(chosen, [](MaterialId m) { return m == kUndecided; });
    std::vector<LostPart> rest;
    for (std::size_t i = 0; i < open.size(); ++i) {
      if (chosen[i] == kUndecided && !stuck) {
        rest.push_back(open[i]);
        continue;
      }
      if (stuck) --report.reassigned;
      for (std::uint32_t j = open[i].first; j < open[i].first + open[i].count; ++j) {
        cells_.set_material(lost_cells_[j], stuck ? material_ : chosen[i]);
        changed_.push_back(lost_cells_[j]);
      }
    }
    open = std::move(rest);
  }
}

template class PaperSeparation<2>;
template class PaperSeparation<3>;
template class PaperSeparation<4>;

}  // namespace treemarch
