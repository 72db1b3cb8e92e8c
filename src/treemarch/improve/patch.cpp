#include "treemarch/improve/patch.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <tuple>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/topology/simplices.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 14;

}  // namespace

template <int Dim>
Patch<Dim>::Patch(Mesh<Dim>& mesh, std::vector<VertexId> chosen, const Execution& execution)
    : mesh_(mesh), block_(mesh.blocks[0]), chosen_(std::move(chosen)) {
  slot_ = filled(execution, mesh.points.size(), 0U);
  for (std::size_t s = 0; s < chosen_.size(); ++s) slot_[chosen_[s]] = static_cast<std::uint32_t>(s + 1);
  stars_.resize(chosen_.size());
  if (mesh.blocks.size() > 1) fixed_.assign(mesh.points.size(), 0);
  for (std::size_t b = 1; b < mesh.blocks.size(); ++b)
    for (const VertexId v : mesh.blocks[b].vertices) fixed_[v] = 1;
  collect(execution);
}

template <int Dim>
void Patch<Dim>::collect(const Execution& execution) {
  const std::int64_t cells = block_.size();
  Marks marked(slot_.size());
  for (const VertexId v : chosen_) marked.mark(v);
  const auto touched = [&](std::int64_t c) {
    if (!alive(static_cast<CellId>(c))) return false;
    bool any = false;
    for (int k = 0; k <= Dim; ++k) any |= marked[block_.vertices[c * (Dim + 1) + k]];
    return any;
  };
  const auto for_corners = [&](CellId c, auto&& use) {
    for (const VertexId v : cell(c))
      if (slot_[v] != 0) use(stars_[slot_[v] - 1]);
  };
  // The cells that are part of a star, per block of cells.
  std::vector<std::vector<CellId>> found(static_cast<std::size_t>(block_count(cells, kBlock)));
  parallel_for(execution, static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t b) {
    for (std::int64_t c = b * kBlock; c < std::min(cells, (b + 1) * kBlock); ++c) {
      if (!touched(c)) continue;
      found[b].push_back(static_cast<CellId>(c));
      for_corners(found[b].back(),
                  [](Star& s) { std::atomic_ref(s.capacity).fetch_add(1, std::memory_order_relaxed); });
    }
  });
  std::int64_t total = 0;
  for (Star& s : stars_) s.first = total, total += s.capacity;
  pool_.resize(static_cast<std::size_t>(total));
  parallel_for(execution, static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t b) {
    for (const CellId c : found[b])
      for_corners(
          c, [&](Star& s) { pool_[s.first + std::atomic_ref(s.size).fetch_add(1, std::memory_order_relaxed)] = c; });
  });
  // Threads come in any order; sorted stars do not.
  parallel_for(execution, static_cast<std::int64_t>(stars_.size()), 256, [&](std::int64_t s) {
    const auto first = pool_.begin() + stars_[s].first;
    std::sort(first, first + stars_[s].size);
  });
}

template <int Dim>
CellId Patch<Dim>::neighbour(CellId c, int corner) const {
  const SimplexVertices<Dim> v = cell(c);
  VertexId with_star = kNoVertex;
  for (int k = 0; k <= Dim; ++k)
    if (k != corner && has_star(v[k]) && (with_star == kNoVertex || star(v[k]).size() < star(with_star).size()))
      with_star = v[k];
  if (with_star == kNoVertex) return kNoCell;
  for (const CellId other : star(with_star)) {
    if (other == c) continue;
    const SimplexVertices<Dim> w = cell(other);
    int shared = 0;
    for (int k = 0; k <= Dim; ++k) shared += k != corner && std::find(w.begin(), w.end(), v[k]) != w.end();
    if (shared == Dim) return other;
  }
  return kNoCell;
}

template <int Dim>
std::vector<CellId> Patch<Dim>::cells_around(std::span<const VertexId> vertices) const {
  std::vector<CellId> found;
  for (const CellId c : star(vertices[0])) {
    const SimplexVertices<Dim> w = cell(c);
    if (std::ranges::all_of(vertices, [&](VertexId v) { return std::ranges::find(w, v) != w.end(); }))
      found.push_back(c);
  }
  return found;
}

template <int Dim>
void Patch<Dim>::insert(VertexId v, CellId c) {
  if (!has_star(v)) return;
  Star& s = stars_[slot_[v] - 1];
  if (s.size == s.capacity) {  // to the end of the pool, with room to grow
    const auto old = s.first;
    s.first = static_cast<std::int64_t>(pool_.size());
    s.capacity = 2 * s.capacity + 4;
    pool_.resize(pool_.size() + s.capacity);
    std::copy_n(pool_.begin() + old, s.size, pool_.begin() + s.first);
  }
  pool_[s.first + s.size++] = c;
}

template <int Dim>
void Patch<Dim>::erase(VertexId v, CellId c) {
  if (!has_star(v)) return;
  Star& s = stars_[slot_[v] - 1];
  const auto first = pool_.begin() + s.first;
  const auto at = std::find(first, first + s.size, c);
  *at = *(first + --s.size);
}

template <int Dim>
void Patch<Dim>::write(CellId c, const NewCell<Dim>& next) {
  if (alive(c))
    for (const VertexId v : cell(c)) erase(v, c);
  std::copy(next.vertices.begin(), next.vertices.end(), block_.vertices.begin() + std::size_t{c} * (Dim + 1));
  block_.materials[c] = next.material;
  if (alive(c))
    for (const VertexId v : next.vertices) insert(v, c);
}

template <int Dim>
void Patch<Dim>::replace(std::span<const CellId> old_cells, std::span<const NewCell<Dim>> new_cells) {
  NewCell<Dim> dead{};
  dead.vertices.fill(kNoVertex);
  const auto put = [&](CellId c, const NewCell<Dim>& next) {
    if (recording_) log_.push_back({c, {cell(c), material(c)}});
    write(c, next);
  };
  std::size_t i = 0;
  for (; i < old_cells.size(); ++i) put(old_cells[i], i < new_cells.size() ? new_cells[i] : dead);
  for (std::size_t k = new_cells.size(); k < old_cells.size(); ++k) free_.push_back(old_cells[k]);
  for (; i < new_cells.size(); ++i) {
    CellId c = static_cast<CellId>(block_.size());
    if (!free_.empty()) {
      c = free_.back();
      free_.pop_back();
    } else {
      block_.vertices.insert(block_.vertices.end(), Dim + 1, kNoVertex);
      block_.materials.push_back(0);
    }
    put(c, new_cells[i]);
  }
}

template <int Dim>
VertexId Patch<Dim>::add_vertex(const Vec<Dim>& x) {
  const auto v = static_cast<VertexId>(mesh_.points.size());
  mesh_.points.push_back(x);
  chosen_.push_back(v);
  stars_.emplace_back();
  slot_.push_back(static_cast<std::uint32_t>(chosen_.size()));
  return v;
}

template <int Dim>
void Patch<Dim>::begin() {
  recording_ = true;
  log_.clear();
  moved_.clear();
  points_at_begin_ = mesh_.points.size();
}

template <int Dim>
void Patch<Dim>::commit() {
  recording_ = false;
}

template <int Dim>
void Patch<Dim>::rollback() {
  recording_ = false;
  for (auto w = log_.rbegin(); w != log_.rend(); ++w) write(w->cell, w->before);
  for (auto m = moved_.rbegin(); m != moved_.rend(); ++m) mesh_.points[m->first] = m->second;
  const std::size_t added = mesh_.points.size() - points_at_begin_;
  mesh_.points.resize(points_at_begin_);
  slot_.resize(points_at_begin_);
  chosen_.resize(chosen_.size() - added);
  stars_.resize(chosen_.size());
  // The free list, anew: cells written are free exactly if they are dead now.
  std::vector<CellId> cells;
  for (const Written& w : log_) cells.push_back(w.cell);
  std::ranges::sort(cells);
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::erase_if(free_, [&](CellId c) { return std::ranges::binary_search(cells, c); });
  for (const CellId c : cells)
    if (!alive(c)) free_.push_back(c);
}

template <int Dim>
std::vector<CellId> Patch<Dim>::written() const {
  std::vector<CellId> cells;
  for (const Written& w : log_)
    if (alive(w.cell)) cells.push_back(w.cell);
  for (const auto& m : moved_)
    if (m.first < slot_.size() && has_star(m.first))
      for (const CellId c : star(m.first)) cells.push_back(c);
  std::ranges::sort(cells);
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  return cells;
}

template <int Dim>
template <class F>
bool Patch<Dim>::any_anchor_in(const Vec<Dim>& low, const Vec<Dim>& high, F&& f) const {
  const auto first_from = [&](double x, double y) {
    const auto before = [](const Anchor& a, const std::array<double, 2>& xy) {
      return a.point[0] != xy[0] ? a.point[0] < xy[0] : a.point[1] < xy[1];
    };
    return std::lower_bound(anchors_.begin(), anchors_.end(), std::array{x, y}, before);
  };
  // Anchors are centres of voxels: many have the same first coordinate.
  auto a = first_from(low[0], low[1]);
  while (a != anchors_.end() && a->point[0] <= high[0]) {
    if (a->point[1] < low[1]) {
      a = first_from(a->point[0], low[1]);
    } else if (a->point[1] > high[1]) {
      a = first_from(std::nextafter(a->point[0], high[0] + 1), low[1]);
    } else {
      if ((Dim == 2 || (low[Dim - 1] <= a->point[Dim - 1] && a->point[Dim - 1] <= high[Dim - 1])) && f(*a)) return true;
      ++a;
    }
  }
  return false;
}

template <int Dim>
bool Patch<Dim>::has_anchors(const Vec<Dim>& low, const Vec<Dim>& high) const {
  return any_anchor_in(low, high, [](const Anchor&) { return true; });
}

template <int Dim>
bool Patch<Dim>::keeps_anchors(VertexId v, const Vec<Dim>& x) const {
  if (anchors_.empty()) return true;
  Vec<Dim> low, high;
  for (int d = 0; d < Dim; ++d) std::tie(low[d], high[d]) = std::minmax({point(v)[d], x[d]});
  for (const CellId c : star(v))
    for (const VertexId w : cell(c))
      for (int d = 0; d < Dim; ++d) {
        low[d] = std::min(low[d], point(w)[d]);
        high[d] = std::max(high[d], point(w)[d]);
      }
  const auto contained = [&](const Vec<Dim>& anchor, MaterialId m, const Vec<Dim>& at) {
    constexpr double kTolerance = 1e-9;
    return std::ranges::any_of(star(v), [&](CellId c) {
      if (material(c) != m) return false;
      const SimplexVertices<Dim> corners = cell(c);
      Simplex<Dim> simplex;
      for (int k = 0; k <= Dim; ++k) simplex[k] = corners[k] == v ? at : point(corners[k]);
      const Barycentric<Dim> barycentric(simplex);
      return barycentric.is_valid() && barycentric.contains(anchor, kTolerance);
    });
  };
  return !any_anchor_in(low, high, [&](const Anchor& anchor) {
    Vec<Dim> p;
    std::copy_n(anchor.point.begin(), Dim, p.begin());
    return contained(p, anchor.material, point(v)) == anchor.inside &&
           contained(p, anchor.material, x) != anchor.inside;
  });
}

template <int Dim>
void Patch<Dim>::list_removed(Removed& removed) const {
  removed.cells.insert(removed.cells.end(), free_.begin(), free_.end());
  for (std::size_t s = 0; s < chosen_.size(); ++s)
    if (stars_[s].size == 0 && !fixed(chosen_[s])) removed.vertices.push_back(chosen_[s]);
}

template <int Dim>
void compact(Mesh<Dim>& mesh, Removed removed, const Execution& execution) {
  CellBlock& block = mesh.blocks[0];
  // From the last hole on, so that the last cell is never a hole.
  std::ranges::sort(removed.cells, std::greater<>());
  for (const CellId hole : removed.cells) {
    const auto last = static_cast<std::size_t>(block.size() - 1);
    std::copy_n(block.vertices.begin() + last * (Dim + 1), Dim + 1,
                block.vertices.begin() + std::size_t{hole} * (Dim + 1));
    block.materials[hole] = block.materials[last];
    block.vertices.resize(last * (Dim + 1));
    block.materials.pop_back();
  }
  std::vector<VertexId>& unused = removed.vertices;
  if (unused.empty()) return;
  std::ranges::sort(unused);
  unused.erase(std::unique(unused.begin(), unused.end()), unused.end());
  const auto count = static_cast<VertexId>(mesh.points.size() - unused.size());
  // The used vertices from the new count on, ascending, take the unused numbers below it, ascending.
  std::vector<VertexId> moved;
  std::size_t skip = std::ranges::lower_bound(unused, count) - unused.begin();
  for (VertexId v = count; v < mesh.points.size(); ++v) {
    if (skip < unused.size() && unused[skip] == v) {
      ++skip;
      continue;
    }
    mesh.points[unused[moved.size()]] = mesh.points[v];
    moved.push_back(v);
  }
  mesh.points.resize(count);
  for (CellBlock& cells : mesh.blocks)
    parallel_for(execution, static_cast<std::int64_t>(cells.vertices.size()), 1 << 16, [&](std::int64_t i) {
      VertexId& v = cells.vertices[i];
      if (v >= count) v = unused[std::ranges::lower_bound(moved, v) - moved.begin()];
    });
}

template void compact(Mesh<2>&, Removed, const Execution&);
template void compact(Mesh<3>&, Removed, const Execution&);
template class Patch<2>;
template class Patch<3>;

}  // namespace treemarch
