#include "treemarch/improve/flips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "treemarch/improve/stratum.h"

namespace treemarch {
namespace {

constexpr double kRise = 0.01;        // degrees
constexpr double kFlat = 0.85;        // cosine between normals
constexpr std::size_t kLongest = 10;  // ring of an edge that may go

template <int Dim>
bool replace_if_better(Patch<Dim>& patch, std::span<const CellId> old_cells, std::span<const NewCell<Dim>> new_cells) {
  if (!(quality_of<Dim>(patch, new_cells) > quality_of<Dim>(patch, old_cells) + kRise)) return false;
  patch.replace(old_cells, new_cells);
  return true;
}

Vec<3> unit_normal(const Patch<3>& patch, VertexId a, VertexId b, VertexId c) {
  const Vec<3> n = cross(patch.point(b) - patch.point(a), patch.point(c) - patch.point(a));
  return (1 / norm(n)) * n;
}

/// The cells around an edge a-b in order: cell i has the corners (a, b, rim[i], rim[i + 1]), positive. A ring that is
/// open has one more rim vertex than cells; else the last cell ends at rim[0].
struct Ring {
  std::vector<CellId> cells;
  std::vector<VertexId> rim;
  bool closed = false;
};

/// \return an empty ring if the cells make no single chain.
Ring ring_around(const Patch<3>& patch, VertexId a, VertexId b) {
  struct Link {
    CellId cell;
    VertexId from, to;
  };
  std::vector<Link> links;
  const std::array<VertexId, 2> edge{a, b};
  for (const CellId c : patch.cells_around(edge)) {
    SimplexVertices<3> v = patch.cell(c);
    // Even permutations bring a and b to the front.
    const auto swap_pairs = [&](int i, int j, int k, int l) {
      std::swap(v[i], v[j]);
      std::swap(v[k], v[l]);
    };
    if (const auto at = std::ranges::find(v, a) - v.begin(); at != 0)
      swap_pairs(0, static_cast<int>(at), at == 1 ? 2 : 1, at == 3 ? 2 : 3);
    while (v[1] != b) std::rotate(v.begin() + 1, v.begin() + 2, v.end());
    links.push_back({c, v[2], v[3]});
  }
  if (links.empty() || links.size() > kLongest) return {};
  std::size_t start = 0;
  for (std::size_t i = 0; i < links.size(); ++i)
    if (std::ranges::none_of(links, [&](const Link& l) { return l.to == links[i].from; })) start = i;
  Ring ring;
  VertexId next = links[start].from;
  ring.rim.push_back(next);
  while (ring.cells.size() < links.size()) {
    const auto link = std::ranges::find(links, next, &Link::from);
    if (link == links.end()) return {};
    ring.cells.push_back(link->cell);
    next = link->to;
    if (next == ring.rim[0]) break;
    ring.rim.push_back(next);
  }
  if (ring.cells.size() < links.size()) return {};
  ring.closed = next == ring.rim[0];
  return ring;
}

/// The best triangles over a chain of rim vertices, each joined to a and to b.
class Fan {
 public:
  Fan(const Patch<3>& patch, VertexId a, VertexId b, std::vector<VertexId> chain)
      : patch_(patch), a_(a), b_(b), chain_(std::move(chain)) {
    const std::size_t n = chain_.size();
    for (std::size_t length = 2; length < n; ++length)
      for (std::size_t i = 0; i + length < n; ++i) {
        Entry& e = at(i, i + length);
        e.quality = -2;
        for (std::size_t k = i + 1; k < i + length; ++k) {
          double q = std::min(at(i, k).quality, at(k, i + length).quality);
          if (q <= e.quality) continue;
          q = std::min(q, quality_of_triangle(i, k, i + length));
          if (q > e.quality) e = {q, k};
        }
      }
  }
  [[nodiscard]] double quality() { return at(0, chain_.size() - 1).quality; }
  void emit(MaterialId material, std::vector<NewCell<3>>& out) { emit(0, chain_.size() - 1, material, out); }

 private:
  struct Entry {
    double quality = 180;
    std::size_t middle = 0;
  };
  Entry& at(std::size_t i, std::size_t j) { return table_[i * (kLongest + 1) + j]; }
  double quality_of_triangle(std::size_t i, std::size_t k, std::size_t j) {
    AngleRange r = patch_.angles({chain_[i], chain_[k], chain_[j], b_});
    r.merge(patch_.angles({chain_[k], chain_[i], chain_[j], a_}));
    return treemarch::quality(r);
  }
  void emit(std::size_t i, std::size_t j, MaterialId material, std::vector<NewCell<3>>& out) {
    if (j - i < 2) return;
    const std::size_t k = at(i, j).middle;
    out.push_back({{chain_[i], chain_[k], chain_[j], b_}, material});
    out.push_back({{chain_[k], chain_[i], chain_[j], a_}, material});
    emit(i, k, material, out);
    emit(k, j, material, out);
  }

  const Patch<3>& patch_;
  VertexId a_, b_;
  std::vector<VertexId> chain_;
  std::array<Entry, (kLongest + 1) * (kLongest + 1)> table_;
};

/// Whether the flip of the edge a-b to p-q within the surface of the triangles (a, b, p) and (b, a, q) keeps it flat.
bool flat(const Patch<3>& patch, VertexId a, VertexId b, VertexId p, VertexId q) {
  const Vec<3> n[] = {unit_normal(patch, a, b, p), unit_normal(patch, b, a, q), unit_normal(patch, p, q, b),
                      unit_normal(patch, q, p, a)};
  for (const Vec<3>& x : n)
    for (const Vec<3>& y : n)
      if (!(dot(x, y) >= kFlat)) return false;
  return true;
}

/// Splits a closed ring at its two changes of material into two chains. \return false if there are not two.
bool split_ring(const Patch<3>& patch, const Ring& ring, std::array<std::vector<VertexId>, 2>& chain) {
  const std::size_t n = ring.cells.size();
  if (n < 4) return false;          // two cells of each material at least
  std::vector<std::size_t> change;  // cells whose predecessor has another material
  for (std::size_t i = 0; i < n; ++i)
    if (patch.material(ring.cells[i]) != patch.material(ring.cells[(i + n - 1) % n])) change.push_back(i);
  if (change.size() != 2) return false;
  for (int side = 0; side < 2; ++side) {
    const std::size_t first = change[side], last = change[1 - side];
    for (std::size_t i = first;; i = (i + 1) % n) {
      chain[side].push_back(ring.rim[i]);
      if (i == last) break;
    }
    if (chain[side].size() < 3) return false;
  }
  return true;
}

}  // namespace

template <int Dim>
double quality_of(const Patch<Dim>& patch, std::span<const NewCell<Dim>> cells) {
  AngleRange all;
  for (const auto& c : cells) all.merge(patch.angles(c.vertices));
  return quality(all);
}

template <int Dim>
double quality_of(const Patch<Dim>& patch, std::span<const CellId> cells) {
  AngleRange all;
  for (const CellId c : cells) all.merge(patch.angles(patch.cell(c)));
  return quality(all);
}

template <int Dim>
bool flip_facet(Patch<Dim>& patch, CellId c, int corner) {
  const CellId other = patch.neighbour(c, corner);
  if (other == Patch<Dim>::kNoCell || patch.material(other) != patch.material(c)) return false;
  const SimplexVertices<Dim> v = patch.cell(c), w = patch.cell(other);
  VertexId opposite = 0;
  for (const VertexId x : w)
    if (std::ranges::find(v, x) == v.end()) opposite = x;
  std::vector<NewCell<Dim>> cells;
  for (int k = 0; k <= Dim; ++k) {
    if (k == corner) continue;
    cells.push_back({v, patch.material(c)});
    cells.back().vertices[k] = opposite;
  }
  const std::array<CellId, 2> old_cells{c, other};
  return replace_if_better<Dim>(patch, old_cells, cells);
}

bool remove_edge(Patch<3>& patch, VertexId a, VertexId b, const Vec<3>& box) {
  if (patch.fixed(a) && patch.fixed(b)) return false;
  const Ring ring = ring_around(patch, a, b);
  if (ring.cells.size() < 2) return false;
  std::vector<NewCell<3>> cells;
  const MaterialId material = patch.material(ring.cells[0]);
  const bool one = std::ranges::all_of(ring.cells, [&](CellId c) { return patch.material(c) == material; });
  if (one) {
    if (ring.rim.size() < 3) return false;
    if (!ring.closed) {
      unsigned axes = ~0U;
      for (const VertexId v : {a, b, ring.rim.front(), ring.rim.back()}) axes &= box_axes(patch.point(v), box);
      if (axes == 0) return false;
    }
    Fan fan(patch, a, b, ring.rim);
    if (fan.quality() <= 0) return false;
    fan.emit(material, cells);
  } else {
    std::array<std::vector<VertexId>, 2> chain;
    if (!ring.closed || !split_ring(patch, ring, chain)) return false;
    if (!flat(patch, a, b, chain[0].front(), chain[0].back())) return false;
    for (const auto& side : chain) {
      Fan fan(patch, a, b, side);
      if (fan.quality() <= 0) return false;
      const auto at = std::ranges::find(ring.rim, side.front()) - ring.rim.begin();
      fan.emit(patch.material(ring.cells[at]), cells);
    }
  }
  return replace_if_better<3>(patch, ring.cells, cells);
}

template <int Dim>
bool collapse_edge(Patch<Dim>& patch, VertexId u, VertexId v, const Vec<Dim>& box) {
  if (patch.fixed(u)) return false;
  const auto star = patch.star(u);
  const MaterialId material = patch.material(star[0]);
  if (std::ranges::any_of(star, [&](CellId c) { return patch.material(c) != material; })) return false;
  const unsigned axes = box_axes(patch.point(u), box);
  for (int d = 0; d < Dim; ++d)
    if ((axes >> d & 1) && patch.point(u)[d] != patch.point(v)[d]) return false;
  const std::vector<CellId> old_cells(star.begin(), star.end());
  std::vector<NewCell<Dim>> cells;
  for (const CellId c : old_cells) {
    SimplexVertices<Dim> w = patch.cell(c);
    if (std::ranges::find(w, v) != w.end()) continue;
    *std::ranges::find(w, u) = v;
    cells.push_back({w, material});
  }
  // Both fill the same room if all are positive and the volume is the same; else the hull would change.
  const auto volume = [&](const SimplexVertices<Dim>& w) {
    const Vec<Dim> p = patch.point(w[0]), x = patch.point(w[1]) - p, y = patch.point(w[2]) - p;
    if constexpr (Dim == 2)
      return x[0] * y[1] - x[1] * y[0];
    else
      return dot(cross(x, y), patch.point(w[3]) - p);
  };
  double before = 0, after = 0;
  for (const CellId c : old_cells) before += volume(patch.cell(c));
  for (const auto& c : cells) after += volume(c.vertices);
  if (!(std::abs(before - after) <= 1e-9 * before)) return false;
  return replace_if_better<Dim>(patch, old_cells, cells);
}

template double quality_of(const Patch<2>&, std::span<const NewCell<2>>);
template double quality_of(const Patch<3>&, std::span<const NewCell<3>>);
template double quality_of(const Patch<2>&, std::span<const CellId>);
template double quality_of(const Patch<3>&, std::span<const CellId>);
template bool flip_facet(Patch<2>&, CellId, int);
template bool flip_facet(Patch<3>&, CellId, int);
template bool collapse_edge(Patch<2>&, VertexId, VertexId, const Vec<2>&);
template bool collapse_edge(Patch<3>&, VertexId, VertexId, const Vec<3>&);

}  // namespace treemarch
