#include "treemarch/topology/mesh_components.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <span>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/topology/vertex_link.h"

// Most vertices lie inside one material: all cells around such a vertex belong to one component, so the vertex can
// stand for them, and no facet that contains it needs to be matched. What is left are the facets whose vertices all lie
// on interfaces or on the hull; those that separate materials also tell where a boundary is no manifold.

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;
constexpr MaterialId kUnused = kOutside;

/// Threads may note the same at once.
void note(MaterialId& at, MaterialId material) {
  const std::atomic_ref place(at);
  if (place.load(std::memory_order_relaxed) != material) place.store(material, std::memory_order_relaxed);
}

}  // namespace

template <int Dim>
MeshComponents<Dim>::MeshComponents(const Mesh<Dim>& mesh, const Execution& execution, const KnownOfMesh<Dim>& known)
    : mesh_(mesh),
      known_(known),
      border_(mesh.points.size()),
      material_of_part_(filled(execution, mesh.points.size(), kUnused)) {
  mark_borders(execution);
  // Uniform cells have inner vertices, and need no number.
  std::size_t n = mesh.points.size() - static_cast<std::size_t>(known.uniform_cells);
  for (const CellBlock& block : mesh.blocks) {
    first_cell_.push_back(n);
    n += block.materials.size();
  }
  if (n > std::numeric_limits<Index>::max())
    throw Error(ErrorKind::limits, "mesh: more than 2^32 vertices and cells; choose larger cells");
  sets_ = SharedDisjointSets(n, execution);
  join_uniform(execution);
  join_inside(execution);
  join_at_borders(execution);
  if constexpr (Dim < 4) find_pinches(execution);
}

template <int Dim>
void MeshComponents<Dim>::mark_borders(const Execution& execution) {
  if (known_.borders) {
    border_ = known_.borders->vertices;
    return;
  }
  if (known_.at_interfaces.empty())
    mark_interfaces(mesh_, known_.uniform_cells, border_, execution);
  else
    std::ranges::copy(known_.at_interfaces, border_.begin());
  if (known_.fills)
    mark_sides(*known_.fills, execution);
  else
    mark_hull(mesh_, known_.uniform_cells, border_, execution);
}

/// Marks vertices on the sides of the box that the mesh fills.
template <int Dim>
void MeshComponents<Dim>::mark_sides(const Vec<Dim>& far_corner, const Execution& execution) {
  constexpr double kTolerance = 1e-9;
  parallel_for(execution, std::ssize(border_), 1 << 16, [&](std::int64_t v) {
    const Vec<Dim>& x = mesh_.points[static_cast<std::size_t>(v)];
    bool on_side = false;
    for (int d = 0; d < Dim; ++d)
      on_side |= x[d] < kTolerance * far_corner[d] || x[d] > (1 - kTolerance) * far_corner[d];
    std::uint8_t& border = border_[static_cast<std::size_t>(v)];
    if (on_side && border == kInside) border = kSide;
  });
}

template <int Dim>
void MeshComponents<Dim>::join_uniform(const Execution& execution) {
  const CellBlock& block = mesh_.blocks[0];
  parallel_for(execution, known_.uniform_cells, kCellsPerTask, [&](std::int64_t c) {
    const VertexId* v = block.cell(c);
    const VertexId part = *std::min_element(v, v + vertex_count(block.type));
    note(material_of_part_[part], block.materials[static_cast<std::size_t>(c)]);
    for (int i = 0; i < vertex_count(block.type); ++i) sets_.join(part, v[i]);
  });
}

template <int Dim>
void MeshComponents<Dim>::join_inside(const Execution& execution) {
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
    const CellBlock& block = mesh_.blocks[b];
    const int n = vertex_count(block.type);
    const std::int64_t first = b == 0 ? known_.uniform_cells : 0;
    std::vector<std::vector<CellPlace>> found(
        static_cast<std::size_t>(block_count(block.size() - first, kCellsPerTask)));
    parallel_for(execution, std::ssize(found), 1, [&](std::int64_t task) {
      const std::int64_t begin = first + task * kCellsPerTask;
      for (std::int64_t c = begin; c < std::min(block.size(), begin + kCellsPerTask); ++c) {
        const VertexId* v = block.cell(c);
        if (std::none_of(v, v + n, [&](VertexId x) { return border_[x] == kInside; }))
          found[static_cast<std::size_t>(task)].push_back({static_cast<std::uint8_t>(b), c});
        const Index part = part_of(b, c);
        if (is_cell(part)) continue;
        note(material_of_part_[part], block.materials[static_cast<std::size_t>(c)]);
        for (int i = 0; i < n; ++i)
          if (border_[v[i]] != kBorder) sets_.join(part, v[i]);
      }
    });
    for (const auto& in_task : found) cells_at_borders_.insert(cells_at_borders_.end(), in_task.begin(), in_task.end());
  }
}

/// Of the facets without an inner vertex, which all border facets are.
template <int Dim>
void MeshComponents<Dim>::join_at_borders(const Execution& execution) {
  const auto material = [&](const FacetSide& s) { return mesh_.blocks[s.block].materials[s.cell]; };
  const auto part = [&](const FacetSide& s) { return part_of(s.block, static_cast<std::int64_t>(s.cell)); };
  const auto look = [&](const SharedFacet& facet, std::vector<BorderFacet>& borders) {
    const MaterialId own = material(facet.own), beyond = facet.is_on_hull() ? kOutside : material(facet.beyond);
    if (own != beyond)
      borders.push_back({facet.own, own, beyond});
    else
      sets_.join(part(facet.own), part(facet.beyond));
  };
  std::vector<std::vector<BorderFacet>> found;
  if (known_.borders) {
    const RawVector<SharedFacet>& facets = known_.borders->facets;
    found.resize(static_cast<std::size_t>(block_count(std::ssize(facets), kCellsPerTask)));
    parallel_for(execution, std::ssize(found), 1, [&](std::int64_t task) {
      const std::int64_t end = std::min(std::ssize(facets), (task + 1) * kCellsPerTask);
      for (std::int64_t i = task * kCellsPerTask; i < end; ++i)
        look(facets[static_cast<std::size_t>(i)], found[static_cast<std::size_t>(task)]);
    });
  } else {
    found.resize(static_cast<std::size_t>(facet_part_count(static_cast<std::int64_t>(mesh_.points.size()))));
    visit_facets(mesh_, execution,
                 [&](std::int64_t at, std::span<const FacetSide> sides) {
                   look(shared_facet(sides), found[static_cast<std::size_t>(at)]);
                 },
                 {border_, known_.uniform_cells});
  }
  facets_ = joined(execution, found);
}

/// Looks at each vertex with the border facets around it.
template <int Dim>
void MeshComponents<Dim>::find_pinches(const Execution& execution) requires(Dim < 4) {
  constexpr std::int64_t kVerticesPerPart = 4096;
  struct LinkFacet {
    VertexId a, b;  // neighbours of the vertex along the rim
    MaterialId first, second;
  };
  const auto for_each_border_vertex = [&](auto&& f) {
    parallel_for(execution, std::ssize(facets_), kCellsPerTask, [&](std::int64_t i) {
      const BorderFacet& border = facets_[static_cast<std::size_t>(i)];
      const CellBlock& block = mesh_.blocks[border.side.block];
      for_each_corner(topology(block.type).facets[border.side.facet], block.cell(border.side.cell),
                      [&](VertexId v, VertexId next, VertexId previous) {
                        if (border_[v] == kBorder) f(v, LinkFacet{next, previous, border.material, border.beyond});
                      });
    });
  };
  RawVector<std::uint32_t> cursor = filled(execution, mesh_.points.size() + 1, 0U);
  for_each_border_vertex(
      [&](VertexId v, const LinkFacet&) { std::atomic_ref(cursor[v]).fetch_add(1, std::memory_order_relaxed); });
  RawVector<LinkFacet> around(exclusive_scan(std::span(cursor)));
  for_each_border_vertex([&](VertexId v, const LinkFacet& facet) {
    around[std::atomic_ref(cursor[v]).fetch_add(1, std::memory_order_relaxed)] = facet;
  });
  // Each cursor now stands at the end of its list.
  std::vector<std::vector<MeshPinch>> found(
      static_cast<std::size_t>(block_count(std::ssize(mesh_.points), kVerticesPerPart)));
  parallel_for(execution, std::ssize(found), 1, [&](std::int64_t part) {
    VertexLink<Dim> link;
    const auto last = std::min(mesh_.points.size(), static_cast<std::size_t>((part + 1) * kVerticesPerPart));
    for (auto v = static_cast<std::size_t>(part * kVerticesPerPart); v < last; ++v) {
      const std::uint32_t begin = v ? cursor[v - 1] : 0;
      if (begin == cursor[v]) continue;
      link.clear();
      for (std::uint32_t i = begin; i < cursor[v]; ++i)
        link.add_facet(around[i].a, around[i].b, around[i].first, around[i].second);
      for (const auto& e : link.excess())
        found[static_cast<std::size_t>(part)].push_back({static_cast<VertexId>(v), e.material, e.sheets});
    }
  });
  for (const auto& part : found) pinches_.insert(pinches_.end(), part.begin(), part.end());
}

template <int Dim>
std::vector<std::int64_t> MeshComponents<Dim>::count(const Execution& execution) const {
  std::vector<std::int64_t> count(mesh_.labels.size());
  const auto add = [&](MaterialId m) { std::atomic_ref(count[m]).fetch_add(1, std::memory_order_relaxed); };
  parallel_for(execution, std::ssize(border_), 1 << 16, [&](std::int64_t v) {
    const MaterialId m = material_of_part_[static_cast<std::size_t>(v)];
    if (m != kUnused && sets_.is_root(static_cast<Index>(v))) add(m);
  });
  for (const auto& [b, c] : cells_at_borders_)
    if (const Index part = part_of(b, c); is_cell(part) && sets_.is_root(part))
      add(mesh_.blocks[b].materials[static_cast<std::size_t>(c)]);
  return count;
}

/// The number of a component is that of its smallest vertex off all interfaces, if it has any: mostly an inner one.
template <int Dim>
Marks MeshComponents<Dim>::with_inner_vertex(const Execution& execution) const {
  Marks known(index_end()), open(index_end());
  parallel_for(execution, std::ssize(cells_at_borders_), kCellsPerTask, [&](std::int64_t i) {
    const CellPlace& place = cells_at_borders_[static_cast<std::size_t>(i)];
    const Index component = of(place.block, place.cell);
    if (!is_cell(component)) (border_[component] == kInside ? known : open).mark(component);
  });
  std::size_t left = open.vertices().size();
  for (std::size_t v = 0; v < border_.size() && left > 0; ++v) {
    if (border_[v] != kInside) continue;
    const Index component = sets_.find(static_cast<Index>(v));
    if (!open[component] || known[component]) continue;
    known.mark(component);
    --left;
  }
  return known;
}

template class MeshComponents<2>;
template class MeshComponents<3>;
template class MeshComponents<4>;

}  // namespace treemarch
