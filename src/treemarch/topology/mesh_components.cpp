#include "treemarch/topology/mesh_components.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <span>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/border_vertices.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/topology/vertex_link.h"

// Most vertices lie inside one material: all cells around such a vertex belong to one component, so the vertex can
// stand for them, and no facet that contains it needs to be matched. What is left are the facets whose vertices all lie
// on interfaces or on the hull; those that separate materials also tell where a boundary is no manifold.

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;
constexpr MaterialId kUnused = kOutside;

}  // namespace

template <int Dim>
MeshComponents<Dim>::MeshComponents(const Mesh<Dim>& mesh, const Execution& execution, const KnownOfMesh<Dim>& known)
    : mesh_(mesh), known_(known), border_(mesh.points.size()), material_of_vertex_(mesh.points.size(), kUnused) {
  mark_interfaces(execution);
  if (known.fills)
    mark_sides(*known.fills, execution);
  else
    mark_hull(mesh, known.uniform_cells, border_, execution);
  // Uniform cells have inner vertices, and need no number.
  std::size_t n = mesh.points.size() - static_cast<std::size_t>(known.uniform_cells);
  for (const CellBlock& block : mesh.blocks) {
    first_cell_.push_back(n);
    n += block.materials.size();
  }
  if (n > std::numeric_limits<Index>::max())
    throw Error(ErrorKind::limits, "mesh: more than 2^32 vertices and cells; choose larger cells");
  sets_ = SharedDisjointSets(n, execution);
  join_inside(execution);
  join_at_borders(execution);
  if constexpr (Dim < 4) find_pinches(execution);
}

template <int Dim>
template <class F>
void MeshComponents<Dim>::for_each_near_cell(const Execution& execution, F&& f) const {
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
    const std::int64_t first = b == 0 ? known_.uniform_cells : 0;
    parallel_for(execution, mesh_.blocks[b].size() - first, kCellsPerTask, [&](std::int64_t c) { f(b, first + c); });
  }
}

/// Marks vertices with cells of several materials.
template <int Dim>
void MeshComponents<Dim>::mark_interfaces(const Execution& execution) {
  for_each_near_cell(execution, [&](std::size_t b, std::int64_t c) {
    const CellBlock& block = mesh_.blocks[b];
    const VertexId* v = block.cell(c);
    const MaterialId material = block.materials[static_cast<std::size_t>(c)];
    for (int i = 0; i < vertex_count(block.type); ++i) {
      const std::atomic_ref<MaterialId> of_vertex(material_of_vertex_[v[i]]);
      MaterialId known = of_vertex.load(std::memory_order_relaxed);
      if (known == material) continue;
      if (known == kUnused && of_vertex.compare_exchange_strong(known, material, std::memory_order_relaxed)) continue;
      if (known != material) std::atomic_ref(border_[v[i]]).store(kBorder, std::memory_order_relaxed);
    }
  });
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
void MeshComponents<Dim>::join_inside(const Execution& execution) {
  const auto join = [&](std::size_t b, std::int64_t c, bool note) {
    const MaterialId material = mesh_.blocks[b].materials[static_cast<std::size_t>(c)];
    const VertexId* v = mesh_.blocks[b].cell(c);
    const auto part = part_of(b, c);
    if (is_cell(part)) return;
    for (int i = 0; i < vertex_count(mesh_.blocks[b].type); ++i) {
      if (border_[v[i]] == kBorder) continue;
      sets_.join(part, v[i]);
      const std::atomic_ref<MaterialId> of_vertex(material_of_vertex_[v[i]]);
      if (note && of_vertex.load(std::memory_order_relaxed) != material)
        of_vertex.store(material, std::memory_order_relaxed);
    }
  };
  parallel_for(execution, known_.uniform_cells, kCellsPerTask, [&](std::int64_t c) { join(0, c, true); });
  for_each_near_cell(execution, [&](std::size_t b, std::int64_t c) { join(b, c, false); });
}

/// Of the facets without an inner vertex, which all border facets are.
template <int Dim>
void MeshComponents<Dim>::join_at_borders(const Execution& execution) {
  const auto material = [&](const FacetSide& s) {
    return mesh_.blocks[s.block].materials[static_cast<std::size_t>(s.cell)];
  };
  std::vector<std::vector<BorderFacet>> found(
      static_cast<std::size_t>(facet_part_count(static_cast<std::int64_t>(mesh_.points.size()))));
  visit_facets(mesh_, execution,
               [&](std::int64_t part, std::span<const FacetSide> sides) {
                 const MaterialId own = material(sides[0]), beyond = sides.size() > 1 ? material(sides[1]) : kOutside;
                 if (own != beyond)
                   found[static_cast<std::size_t>(part)].push_back({sides[0], beyond});
                 else
                   sets_.join(part_of(sides[0].block, sides[0].cell), part_of(sides[1].block, sides[1].cell));
               },
               {border_, known_.uniform_cells});
  std::vector<std::size_t> first;
  first.reserve(found.size());
  for (const auto& part : found) first.push_back(part.size());
  facets_.resize(exclusive_scan(std::span(first)));
  parallel_for(execution, std::ssize(found), 1, [&](std::int64_t p) {
    const auto part = static_cast<std::size_t>(p);
    std::ranges::copy(found[part], facets_.begin() + static_cast<std::ptrdiff_t>(first[part]));
    found[part] = {};
  });
}

/// Looks at each vertex with the border facets around it.
template <int Dim>
void MeshComponents<Dim>::find_pinches(const Execution& execution) requires(Dim < 4) {
  constexpr std::int64_t kVerticesPerPart = 4096;
  const auto for_each_corner = [&](auto&& f) {
    parallel_for(execution, std::ssize(facets_), kCellsPerTask, [&](std::int64_t i) {
      const FacetSide& side = facets_[static_cast<std::size_t>(i)].side;
      const CellBlock& block = mesh_.blocks[side.block];
      const LocalFacet& facet = topology(block.type).facets[side.facet];
      for (int k = 0; k < facet.size; ++k)
        if (const VertexId v = block.cell(side.cell)[facet.vertex[static_cast<std::size_t>(k)]]; border_[v] == kBorder)
          f(v, static_cast<std::uint32_t>(i));
    });
  };
  std::vector<std::uint32_t> cursor(mesh_.points.size() + 1);
  for_each_corner(
      [&](VertexId v, std::uint32_t) { std::atomic_ref(cursor[v]).fetch_add(1, std::memory_order_relaxed); });
  RawVector<std::uint32_t> around(exclusive_scan(std::span(cursor)));
  for_each_corner([&](VertexId v, std::uint32_t i) {
    around[std::atomic_ref(cursor[v]).fetch_add(1, std::memory_order_relaxed)] = i;
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
      for (std::uint32_t i = begin; i < cursor[v]; ++i) {
        const auto& [side, beyond] = facets_[around[i]];
        const CellBlock& block = mesh_.blocks[side.block];
        link.add_facet(topology(block.type).facets[side.facet], block.cell(side.cell), static_cast<VertexId>(v),
                       block.materials[static_cast<std::size_t>(side.cell)], beyond);
      }
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
    const MaterialId m = material_of_vertex_[static_cast<std::size_t>(v)];
    if (border_[static_cast<std::size_t>(v)] != kBorder && m != kUnused && sets_.is_root(static_cast<Index>(v))) add(m);
  });
  for_each_near_cell(execution, [&](std::size_t b, std::int64_t c) {
    const auto part = static_cast<Index>(first_cell_[b] + static_cast<std::size_t>(c));
    if (sets_.is_root(part) && part_of(b, c) == part) add(mesh_.blocks[b].materials[static_cast<std::size_t>(c)]);
  });
  return count;
}

template class MeshComponents<2>;
template class MeshComponents<3>;
template class MeshComponents<4>;

}  // namespace treemarch
