#include "treemarch/improve/remesh.h"

#include <algorithm>
#include <array>

#include "treemarch/improve/flips.h"

namespace treemarch {
namespace {

constexpr double kRise = 0.01;  // degrees: less is no progress

}  // namespace

template <int Dim>
std::vector<CellId> Remesher<Dim>::bad_cells(double target) const {
  std::vector<CellId> cells;
  for (const VertexId v : patch_.chosen()) {
    const auto star = patch_.star(v);
    cells.insert(cells.end(), star.begin(), star.end());
  }
  std::ranges::sort(cells);
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  const QualityBound bound(target);
  std::erase_if(cells, [&](CellId c) { return meets(patch_.angles(patch_.cell(c)), bound); });
  std::ranges::stable_sort(cells, {}, [&](CellId c) { return quality_of_cell(c); });
  return cells;
}

template <int Dim>
std::int64_t Remesher<Dim>::pass(double target, const std::function<bool()>& stop) {
  std::int64_t improved = 0;
  ++pass_;
  for (const CellId c : bad_cells(target)) {
    if (stop()) break;
    if (!patch_.alive(c) || quality_of_cell(c) >= target || !worth_trying(c)) continue;
    const SimplexVertices<Dim> corners = patch_.cell(c);
    if (!improve_cell(c)) continue;
    ++improved;
    for (const VertexId v : corners) touch(v);
  }
  return improved;
}

/// Notes a change near v.
template <int Dim>
void Remesher<Dim>::touch(VertexId v) {
  touched_.resize(patch_.chosen().size(), 0);
  if (!patch_.has_star(v)) return;
  for (const CellId c : patch_.star(v))
    for (const VertexId w : patch_.cell(c))
      if (patch_.has_star(w)) touched_[patch_.slot(w)] = pass_;
}

/// Whether anything has changed around a cell since the last pass tried it in vain.
template <int Dim>
bool Remesher<Dim>::worth_trying(CellId c) const {
  return pass_ == 1 || std::ranges::any_of(patch_.cell(c), [&](VertexId v) {
           const auto s = patch_.slot(v);
           return s >= static_cast<std::int64_t>(touched_.size()) || (s >= 0 && touched_[s] + 1 >= pass_);
         });
}

template <int Dim>
bool Remesher<Dim>::improve_cell(CellId c) {
  return move_corners(c, false) || flip(c) || collapse(c) || make_room(c) || split(c) || move_corners(c, true);
}

template <int Dim>
bool Remesher<Dim>::move(VertexId v, bool loose, double goal) {
  if (!patch_.has_star(v)) return false;
  MoveLimits limits = limits_;
  limits.goal = goal;
  Vec<Dim> x;
  if (!find_better_place(patch_, v, field_, box_, limits, loose, start_[patch_.slot(v)], x)) return false;
  if (!patch_.keeps_anchors(v, x)) return false;
  patch_.move(v, x);
  ++report_.moves;
  return true;
}

template <int Dim>
bool Remesher<Dim>::move_corners(CellId c, bool loose) {
  const double before = quality_of_cell(c);
  for (const VertexId v : patch_.cell(c)) move(v, loose, limits_.goal);
  return quality_of_cell(c) > before + kRise;
}

template <int Dim>
bool Remesher<Dim>::flip(CellId c) {
  const SimplexVertices<Dim> v = patch_.cell(c);
  for (int k = 0; k <= Dim; ++k)
    if (flip_facet(patch_, c, k)) {
      ++report_.facet_flips;
      return true;
    }
  if constexpr (Dim == 3)
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j)
        if (patch_.has_star(v[i]) && patch_.has_star(v[j]) && remove_edge(patch_, v[i], v[j], box_)) {
          ++report_.edge_removals;
          return true;
        }
  return false;
}

template <int Dim>
bool Remesher<Dim>::collapse(CellId c) {
  const SimplexVertices<Dim> v = patch_.cell(c);
  for (const VertexId u : v)
    for (const VertexId to : v)
      if (u != to && patch_.has_star(u) && collapse_edge(patch_, u, to, box_)) {
        ++report_.collapses;
        return true;
      }
  return false;
}

/// Keeps what change() does if every cell that it touched is better than c was.
template <int Dim>
template <class Change>
bool Remesher<Dim>::attempt(CellId c, Change&& change) {
  const double before = quality_of_cell(c);
  const ImproveReport counts = report_;
  const SimplexVertices<Dim> corners = patch_.cell(c);
  patch_.begin();
  change();
  const std::vector<CellId> written = patch_.written();
  const bool touched = !patch_.alive(c) || patch_.cell(c) != corners || std::ranges::binary_search(written, c);
  if (touched && quality_of<Dim>(patch_, written) > before + kRise) {
    patch_.commit();
    return true;
  }
  patch_.rollback();
  start_.resize(patch_.chosen().size());
  report_ = counts;
  return false;
}

/// Moves the neighbours of c to better places than they need, then its corners.
template <int Dim>
bool Remesher<Dim>::make_room(CellId c) {
  std::vector<VertexId> around;
  const SimplexVertices<Dim> corners = patch_.cell(c);
  for (const VertexId v : corners)
    if (patch_.has_star(v))
      for (const CellId n : patch_.star(v))
        for (const VertexId w : patch_.cell(n)) around.push_back(w);
  std::ranges::sort(around);
  around.erase(std::unique(around.begin(), around.end()), around.end());
  return attempt(c, [&] {
    for (const VertexId w : around)
      if (std::ranges::find(corners, w) == corners.end()) move(w, false, limits_.goal + 10);
    for (int round = 0; round < 2; ++round)
      for (const VertexId v : corners) move(v, false, limits_.goal);
  });
}

template <int Dim>
void Remesher<Dim>::split_edge(VertexId a, VertexId b) {
  const std::array<VertexId, 2> edge{a, b};
  const std::vector<CellId> ring = patch_.cells_around(edge);
  const Vec<Dim> middle = 0.5 * (patch_.point(a) + patch_.point(b));
  const VertexId m = patch_.add_vertex(middle);
  start_.push_back(middle);
  std::vector<NewCell<Dim>> cells;
  for (const CellId c : ring)
    for (const VertexId end : {a, b}) {
      cells.push_back({patch_.cell(c), patch_.material(c)});
      *std::ranges::find(cells.back().vertices, end) = m;
    }
  patch_.replace(ring, cells);
  ++report_.splits;
  const double goal = limits_.goal + 10;
  move(m, false, goal);
  std::vector<VertexId> around;
  for (const CellId c : patch_.star(m))
    for (const VertexId w : patch_.cell(c))
      if (w != m) around.push_back(w);
  std::ranges::sort(around);
  around.erase(std::unique(around.begin(), around.end()), around.end());
  for (int round = 0; round < 2; ++round) {
    for (const VertexId w : around) move(w, false, goal);
    move(m, false, goal);
  }
}

template <int Dim>
bool Remesher<Dim>::split(CellId c) {
  struct Edge {
    double length;
    VertexId a, b;
  };
  std::vector<Edge> edges;
  const SimplexVertices<Dim> v = patch_.cell(c);
  for (int i = 0; i <= Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j)
      if (patch_.has_star(v[i]) && patch_.has_star(v[j]) && !(patch_.fixed(v[i]) && patch_.fixed(v[j])))
        edges.push_back({squared_norm(patch_.point(v[i]) - patch_.point(v[j])), v[i], v[j]});
  std::ranges::stable_sort(edges, std::greater<>(), &Edge::length);
  return std::ranges::any_of(edges, [&](const Edge& e) { return attempt(c, [&] { split_edge(e.a, e.b); }); });
}

template class Remesher<2>;
template class Remesher<3>;

}  // namespace treemarch
