#include "treemarch/repair/unpinch.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <tuple>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/topology/disjoint_sets.h"

namespace treemarch {
namespace {

constexpr int kPasses = 8;
constexpr std::uint32_t kNobody = 0xffffffffU;

/// Whether two simplices share a facet.
template <int Dim>
bool share_facet(const SimplexVertices<Dim>& a, const SimplexVertices<Dim>& b) {
  int shared = 0;
  for (const VertexId v : a) shared += std::ranges::find(b, v) != b.end();
  return shared == Dim;
}

template <int Dim>
void add_vertices(const SimplexVertices<Dim>& cell, std::vector<VertexId>& vertices) {
  for (const VertexId v : cell)
    if (std::ranges::find(vertices, v) == vertices.end()) vertices.push_back(v);
}

/// Area of the facets of a cell to cells of a material.
template <int Dim>
double contact_area(const Patch<Dim>& patch, CellId c, MaterialId material) {
  double area = 0;
  for (int corner = 0; corner <= Dim; ++corner) {
    const CellId next = patch.neighbour(c, corner);
    if (next != Patch<Dim>::kNoCell && patch.material(next) == material) area += facet_area<Dim>(patch, c, corner);
  }
  return area;
}

}  // namespace

template <int Dim>
double facet_area(const Patch<Dim>& patch, CellId c, int corner) {
  const SimplexVertices<Dim> v = patch.cell(c);
  const Vec<Dim>&p = patch.point(v[corner == 0]), &q = patch.point(v[corner <= 1 ? 2 : 1]);
  if constexpr (Dim == 2)
    return norm(q - p);
  else
    return norm(cross(q - p, patch.point(v[corner <= 2 ? 3 : 2]) - p)) / 2;
}

template <int Dim>
bool keeps_connection(const Patch<Dim>& patch, std::span<const CellId> cells) {
  const MaterialId from = patch.material(cells[0]);
  std::vector<VertexId> around;
  for (const CellId c : cells) add_vertices<Dim>(patch.cell(c), around);
  std::vector<CellId> left;
  for (const VertexId v : around)
    for (const CellId c : patch.star(v))
      if (patch.material(c) == from && std::ranges::find(cells, c) == cells.end()) left.push_back(c);
  std::ranges::sort(left);
  left.erase(std::unique(left.begin(), left.end()), left.end());
  std::vector<std::size_t> parent(left.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (std::size_t i = 0; i < left.size(); ++i)
    for (std::size_t j = i + 1; j < left.size(); ++j)
      if (root(i) != root(j) && share_facet<Dim>(patch.cell(left[i]), patch.cell(left[j]))) parent[root(j)] = root(i);
  // Only those that were connected through the move count.
  std::size_t first = left.size();
  for (std::size_t i = 0; i < left.size(); ++i) {
    const bool beside =
        std::ranges::any_of(cells, [&](CellId c) { return share_facet<Dim>(patch.cell(left[i]), patch.cell(c)); });
    if (!beside) continue;
    if (first == left.size()) first = i;
    if (root(i) != root(first)) return false;
  }
  return first != left.size();
}

template <int Dim>
int PinchCounter<Dim>::excess(VertexId v) {
  const auto star = patch_.star(v);
  if (std::ranges::all_of(star, [&](CellId c) { return patch_.material(c) == patch_.material(star[0]); })) return 0;
  link_.clear();
  for (const CellId c : star) {
    const SimplexVertices<Dim> cell = patch_.cell(c);
    link_.add(kSimplex<Dim>, cell.data(), v, patch_.material(c));
  }
  int sum = 0;
  for (const auto& e : link_.excess()) sum += e.sheets;
  return sum;
}

namespace {

/// Treats pinched vertices one after the other.
template <int Dim>
class Unpincher {
 public:
  Unpincher(Patch<Dim>& patch, const Mesh<Dim>& mesh, const LabelImage<Dim>& image, std::span<const CellId> kept)
      : patch_(patch), mesh_(mesh), image_(image), kept_(kept), counter_(patch) {}

  /// Of a pass over some vertices.
  struct Outcome {
    std::vector<CellId> relabelled;
    std::vector<VertexId> pinched;  // those that are left, and those that are pinched by moves
    bool any = false;               // whether there was a move
    bool confined = false;          // a move at one that is left was not tried, as a vertex of it has no star
  };
  Outcome run(std::span<const VertexId> vertices);

 private:
  /// Cells around a vertex that change from one material to another.
  struct Move {
    std::vector<CellId> cells;
    MaterialId to = 0;
    int gain = 0;                // sheets fewer
    std::int64_t agreement = 0;  // cells for which the image is for it, less those for which it is against it
    double volume = 0;
    double contact = 0;  // area of the facets to the material they go to
  };

  bool treat(VertexId v);
  void list_parts(VertexId v);
  void propose_to_others(std::span<const std::size_t> places);  // in the star
  void propose_parts();
  void propose_along_edges(VertexId v);
  void propose_cells();
  [[nodiscard]] int excess_before(VertexId v);
  void propose(std::span<const CellId> cells, MaterialId to);
  bool apply_best();
  [[nodiscard]] MaterialId image_material(CellId c) const;
  void relabel(std::span<const CellId> cells, MaterialId to) {
    for (const CellId c : cells) patch_.relabel(c, to);
  }
  Patch<Dim>& patch_;
  const Mesh<Dim>& mesh_;
  const LabelImage<Dim>& image_;
  const std::span<const CellId> kept_;
  PinchCounter<Dim> counter_;
  std::vector<CellId> star_;
  std::vector<std::array<int, Dim>> beside_;  // the cells of the star beside each of them at the facets at v, or -1
  std::vector<int> part_;  // of each cell of the star: cells of one material that hang together over facets at v
  int parts_ = 0;
  std::vector<CellId> cells_;       // of the moves that propose_to_others() looks at
  std::vector<MaterialId> others_;  // where they go
  std::vector<Move> moves_;
  std::vector<std::pair<VertexId, int>> before_;
  std::vector<VertexId> touched_;
  bool at_rim_ = false;  // a move of the vertex that is treated was not tried, as a vertex of it has no star
  Outcome outcome_;
};

/// Of a vertex near the one that is treated, as its cells are labelled while no move is tried.
template <int Dim>
int Unpincher<Dim>::excess_before(VertexId v) {
  auto at = std::ranges::find(before_, v, [](const auto& known) { return known.first; });
  if (at == before_.end()) at = before_.insert(at, {v, counter_.excess(v)});
  return at->second;
}

template <int Dim>
MaterialId Unpincher<Dim>::image_material(CellId c) const {
  return image_.material(image_.voxel_at(patch_.centroid(c)));
}

template <int Dim>
void Unpincher<Dim>::list_parts(VertexId v) {
  star_.assign(patch_.star(v).begin(), patch_.star(v).end());
  std::ranges::sort(star_);
  const auto n = static_cast<int>(star_.size());
  std::array<int, Dim> none;
  none.fill(-1);
  beside_.assign(star_.size(), none);
  std::vector<int> filled(star_.size(), 0);
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j)
      if (share_facet<Dim>(patch_.cell(star_[i]), patch_.cell(star_[j])))
        beside_[i][filled[i]++] = j, beside_[j][filled[j]++] = i;
  part_.assign(star_.size(), -1);
  parts_ = 0;
  std::vector<int> stack;
  for (int i = 0; i < n; ++i) {
    if (part_[i] >= 0) continue;
    part_[i] = parts_;
    stack.push_back(i);
    while (!stack.empty()) {
      const int at = stack.back();
      stack.pop_back();
      for (const int next : beside_[at]) {
        if (next < 0 || part_[next] >= 0 || patch_.material(star_[next]) != patch_.material(star_[at])) continue;
        part_[next] = parts_;
        stack.push_back(next);
      }
    }
    ++parts_;
  }
}

/// Notes the move if it takes sheets away.
template <int Dim>
void Unpincher<Dim>::propose(std::span<const CellId> cells, MaterialId to) {
  if (std::ranges::any_of(cells, [&](CellId c) { return std::ranges::binary_search(kept_, c); })) return;
  touched_.clear();
  for (const CellId c : cells) add_vertices<Dim>(patch_.cell(c), touched_);
  if (std::ranges::any_of(touched_, [&](VertexId v) { return !patch_.has_star(v); })) {
    at_rim_ = true;
    return;
  }
  const MaterialId from = patch_.material(cells[0]);
  int before = 0, after = 0;
  for (const VertexId v : touched_) before += excess_before(v);
  relabel(cells, to);
  for (auto v = touched_.begin(); v != touched_.end() && after < before; ++v) after += counter_.excess(*v);
  relabel(cells, from);
  if (after >= before) return;
  Move move{{cells.begin(), cells.end()}, to, before - after};
  for (const CellId c : cells) {
    const MaterialId own = image_material(c);
    move.agreement += (own == to) - (own == from);
    const SimplexVertices<Dim> cell = patch_.cell(c);
    move.volume += simplex_determinant<Dim>(mesh_.points.data(), cell.data());
    move.contact += contact_area<Dim>(patch_, c, to);
  }
  moves_.push_back(std::move(move));
}

/// Moves of cells of one part to each of the materials beside them.
template <int Dim>
void Unpincher<Dim>::propose_to_others(std::span<const std::size_t> places) {
  cells_.clear();
  others_.clear();
  for (const std::size_t i : places) {
    cells_.push_back(star_[i]);
    for (const int next : beside_[i])
      if (next >= 0 && part_[next] != part_[i]) others_.push_back(patch_.material(star_[next]));
  }
  std::ranges::sort(others_);
  others_.erase(std::unique(others_.begin(), others_.end()), others_.end());
  for (const MaterialId to : others_) propose(cells_, to);
}

template <int Dim>
void Unpincher<Dim>::propose_parts() {
  std::vector<std::size_t> places;
  for (int p = 0; p < parts_; ++p) {
    places.clear();
    for (std::size_t i = 0; i < star_.size(); ++i)
      if (part_[i] == p) places.push_back(i);
    propose_to_others(places);
  }
}

/// Moves of the cells of a part that contain one more vertex: what lies between two sheets along an edge.
template <int Dim>
void Unpincher<Dim>::propose_along_edges(VertexId v) {
  std::vector<VertexId> rim;
  for (const CellId c : star_) add_vertices<Dim>(patch_.cell(c), rim);
  std::vector<std::size_t> places;
  for (const VertexId w : rim) {
    if (w == v) continue;
    for (int p = 0; p < parts_; ++p) {
      places.clear();
      for (std::size_t i = 0; i < star_.size(); ++i) {
        const SimplexVertices<Dim> cell = patch_.cell(star_[i]);
        if (part_[i] == p && std::ranges::find(cell, w) != cell.end()) places.push_back(i);
      }
      propose_to_others(places);
    }
  }
}

template <int Dim>
void Unpincher<Dim>::propose_cells() {
  for (std::size_t i = 0; i < star_.size(); ++i) propose_to_others(std::span(&i, 1));
}

template <int Dim>
bool Unpincher<Dim>::apply_best() {
  std::ranges::stable_sort(moves_, [](const Move& a, const Move& b) {
    return std::tuple(-a.gain, -a.agreement, a.volume, -a.contact) <
           std::tuple(-b.gain, -b.agreement, b.volume, -b.contact);
  });
  for (const Move& move : moves_) {
    if (!keeps_connection<Dim>(patch_, move.cells)) continue;
    relabel(move.cells, move.to);
    outcome_.relabelled.insert(outcome_.relabelled.end(), move.cells.begin(), move.cells.end());
    touched_.clear();
    for (const CellId c : move.cells) add_vertices<Dim>(patch_.cell(c), touched_);
    for (const VertexId v : touched_)
      if (counter_.excess(v) > 0) outcome_.pinched.push_back(v);
    return true;
  }
  return false;
}

template <int Dim>
bool Unpincher<Dim>::treat(VertexId v) {
  list_parts(v);
  before_.clear();
  moves_.clear();
  at_rim_ = false;
  propose_parts();
  if (apply_best()) return true;
  moves_.clear();
  if constexpr (Dim == 3) propose_along_edges(v);
  propose_cells();
  return apply_best();
}

template <int Dim>
typename Unpincher<Dim>::Outcome Unpincher<Dim>::run(std::span<const VertexId> vertices) {
  outcome_ = {};
  for (const VertexId v : vertices) {
    while (counter_.excess(v) > 0 && treat(v)) outcome_.any = true;
    if (counter_.excess(v) == 0) continue;
    outcome_.pinched.push_back(v);
    outcome_.confined |= at_rim_;
  }
  return std::move(outcome_);
}

/// Sorts vertices into groups: a move at a vertex of one neither changes nor depends on cells that one at a vertex of
/// another can change, as no vertex is joined to both. Within a group they keep their order.
template <int Dim>
std::vector<std::vector<VertexId>> independent_groups(const Patch<Dim>& patch, std::span<const VertexId> vertices,
                                                      RawVector<std::uint32_t>& first_at, const Execution& execution) {
  constexpr std::int64_t kVerticesPerTask = 256;
  const auto for_each_around = [&](auto&& f) {
    parallel_for(execution, std::ssize(vertices), kVerticesPerTask, [&](std::int64_t i) {
      for (const CellId c : patch.star(vertices[static_cast<std::size_t>(i)]))
        for (const VertexId v : patch.cell(c)) f(static_cast<std::uint32_t>(i), std::atomic_ref(first_at[v]));
    });
  };
  SharedDisjointSets sets(vertices.size(), execution);
  for_each_around([&](std::uint32_t i, const std::atomic_ref<std::uint32_t>& at) {
    std::uint32_t other = kNobody;
    if (!at.compare_exchange_strong(other, i, std::memory_order_relaxed)) sets.join(i, other);
  });
  for_each_around(
      [](std::uint32_t, const std::atomic_ref<std::uint32_t>& at) { at.store(kNobody, std::memory_order_relaxed); });
  std::vector<std::uint32_t> group_of(vertices.size());
  std::vector<std::vector<VertexId>> groups;
  for (std::uint32_t i = 0; i < vertices.size(); ++i) {  // the root is the smallest
    const std::uint32_t root = sets.find(i);
    if (root == i) {
      group_of[i] = static_cast<std::uint32_t>(groups.size());
      groups.emplace_back();
    }
    groups[group_of[root]].push_back(vertices[i]);
  }
  return groups;
}

}  // namespace

template <int Dim>
UnpinchReport unpinch(Patch<Dim>& patch, const Mesh<Dim>& mesh, const LabelImage<Dim>& image,
                      std::vector<VertexId> vertices, std::span<const CellId> kept, Execution& execution) {
  using Outcome = typename Unpincher<Dim>::Outcome;
  UnpinchReport report;
  RawVector<std::uint32_t> first_at = filled(execution, mesh.points.size(), kNobody);
  bool any = true;
  for (int pass = 0; pass < kPasses && any && !vertices.empty(); ++pass) {
    const auto groups = independent_groups(patch, vertices, first_at, execution);
    std::vector<Outcome> outcomes(groups.size());
    parallel_for_ranges(execution, std::ssize(groups), 1, [&](std::int64_t begin, std::int64_t end) {
      Unpincher<Dim> unpincher(patch, mesh, image, kept);
      for (std::int64_t g = begin; g < end; ++g)
        outcomes[static_cast<std::size_t>(g)] = unpincher.run(groups[static_cast<std::size_t>(g)]);
    });
    vertices.clear();
    any = report.confined = false;
    for (const Outcome& outcome : outcomes) {
      vertices.insert(vertices.end(), outcome.pinched.begin(), outcome.pinched.end());
      report.relabelled.insert(report.relabelled.end(), outcome.relabelled.begin(), outcome.relabelled.end());
      any |= outcome.any;
      report.confined |= outcome.confined;
    }
    std::ranges::sort(vertices);
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  }
  PinchCounter<Dim> counter(patch);
  for (const VertexId v : vertices) report.left += counter.excess(v);
  return report;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                             \
  template double facet_area(const Patch<DIM>&, CellId, int);                                                  \
  template bool keeps_connection(const Patch<DIM>&, std::span<const CellId>);                                  \
  template class PinchCounter<DIM>;                                                                            \
  template UnpinchReport unpinch(Patch<DIM>&, const Mesh<DIM>&, const LabelImage<DIM>&, std::vector<VertexId>, \
                                 std::span<const CellId>, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
