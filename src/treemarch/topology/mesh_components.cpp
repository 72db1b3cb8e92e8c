#include "treemarch/topology/mesh_components.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/facets.h"
#include "treemarch/topology/stars.h"
#include "treemarch/topology/vertex_link.h"

// Most vertices lie inside one material: all cells around such a vertex belong to one component, so the vertex can
// stand for them, and no facet that contains it needs to be matched. What is left are the facets whose vertices all lie
// on interfaces or on the hull; they are matched in the stars of these vertices, which have to be looked at anyway.

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;
constexpr MaterialId kUnused = kOutside;

/// A bijection that scatters its argument (the finaliser of SplitMix64).
std::uint64_t scatter(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

/// Calls f(block index, cell) for all cells of a mesh, in parallel.
template <int Dim, class F>
void for_each_cell(const Mesh<Dim>& mesh, const Execution& execution, F&& f) {
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    parallel_for(execution, mesh.blocks[b].size(), kCellsPerTask, [&](std::int64_t c) { f(b, c); });
}

/// One a vertex: 0 where all cells around it are of one material and close around it, else 1.
///
/// Each vertex adds up (xor) a hash of each of its facets and of the material behind it. Facets between two cells of
/// one material cancel, all others stay.
template <int Dim>
std::vector<std::uint8_t> find_border_vertices(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::uint64_t> sums(mesh.points.size());
  for_each_cell(mesh, execution, [&](std::size_t b, std::int64_t c) {
    const CellBlock& block = mesh.blocks[b];
    const VertexId* v = block.cell(c);
    const int n = vertex_count(block.type);
    const CellTopology& shape = topology(block.type);
    std::array<std::uint64_t, 8> hash{}, sum{};
    for (int i = 0; i < n; ++i) hash[i] = scatter(v[i]);
    for (int k = 0; k < shape.facet_count; ++k) {
      const LocalFacet& facet = shape.facets[k];
      std::uint64_t h = block.materials[static_cast<std::size_t>(c)];
      for (int i = 0; i < facet.size; ++i) h += hash[facet.vertex[i]];
      h = scatter(h);
      for (int i = 0; i < facet.size; ++i) sum[facet.vertex[i]] ^= h;
    }
    for (int i = 0; i < n; ++i) std::atomic_ref(sums[v[i]]).fetch_xor(sum[i], std::memory_order_relaxed);
  });
  std::vector<std::uint8_t> border(sums.size());
  parallel_for(execution, std::ssize(sums), 1 << 16,
               [&](std::int64_t v) { border[static_cast<std::size_t>(v)] = sums[static_cast<std::size_t>(v)] != 0; });
  return border;
}

}  // namespace

SharedDisjointSets::SharedDisjointSets(std::size_t n) : parent_(n) {
  std::iota(parent_.begin(), parent_.end(), Index{0});
}

template <int Dim>
MeshComponents<Dim>::MeshComponents(const Mesh<Dim>& mesh, const Execution& execution)
    : mesh_(mesh), border_(find_border_vertices(mesh, execution)) {
  std::size_t n = mesh.points.size();
  for (const CellBlock& block : mesh.blocks) {
    first_cell_.push_back(n);
    n += block.materials.size();
  }
  sets_ = SharedDisjointSets(n);
  material_of_vertex_.assign(mesh.points.size(), kUnused);
  join_inside(execution);
  join_at_borders(execution);
}

template <int Dim>
void MeshComponents<Dim>::join_inside(const Execution& execution) {
  for_each_cell(mesh_, execution, [&](std::size_t b, std::int64_t c) {
    const VertexId* v = mesh_.blocks[b].cell(c);
    const auto part = part_of(b, c);
    if (is_cell(part)) return;
    const MaterialId material = mesh_.blocks[b].materials[static_cast<std::size_t>(c)];
    for (int i = 0; i < vertex_count(mesh_.blocks[b].type); ++i) {
      if (border_[v[i]] != 0) continue;
      std::atomic_ref(material_of_vertex_[v[i]]).store(material, std::memory_order_relaxed);
      sets_.join(part, v[i]);
    }
  });
}

/// A facet without an inner vertex is found in the star of its smallest vertex.
template <int Dim>
void MeshComponents<Dim>::join_at_borders(const Execution& execution) {
  if constexpr (Dim == 4) {
    visit_facets(
        mesh_, execution,
        [&](std::int64_t, std::span<const FacetSide> sides) {
          const auto material = [&](const FacetSide& s) {
            return mesh_.blocks[s.block].materials[static_cast<std::size_t>(s.cell)];
          };
          for (std::size_t i = 1; i < sides.size(); ++i)
            if (material(sides[i]) == material(sides[0]))
              sets_.join(part_of(sides[0].block, sides[0].cell), part_of(sides[i].block, sides[i].cell));
        },
        border_);
  } else {
    std::vector<std::vector<MeshPinch>> found(
        static_cast<std::size_t>(star_part_count(static_cast<std::int64_t>(mesh_.points.size()))));
    visit_stars(mesh_, border_, execution, [&](std::int64_t part, VertexId v, std::span<const StarCell> star) {
      thread_local VertexLink<Dim> link;
      link.clear();
      for (std::size_t i = 0; i < star.size(); ++i) {
        const CellBlock& block = mesh_.blocks[star[i].block];
        link.add(block.type, block.cell(star[i].cell), v, block.materials[star[i].cell], static_cast<std::uint32_t>(i),
                 border_.data());
      }
      for (const auto& [i, j] : link.pairs()) {
        const Index a = part_of(star[i].block, star[i].cell), b = part_of(star[j].block, star[j].cell);
        if (a != b) sets_.join(a, b);
      }
      for (const auto& e : link.excess()) found[static_cast<std::size_t>(part)].push_back({v, e.material, e.sheets});
    });
    for (const auto& part : found) pinches_.insert(pinches_.end(), part.begin(), part.end());
  }
}

template <int Dim>
std::vector<std::int64_t> MeshComponents<Dim>::count() const {
  std::vector<std::int64_t> count(mesh_.labels.size());
  for (std::size_t v = 0; v < border_.size(); ++v)
    if (material_of_vertex_[v] != kUnused && sets_.is_root(static_cast<VertexId>(v))) ++count[material_of_vertex_[v]];
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
    for (std::int64_t c = 0; c < mesh_.blocks[b].size(); ++c) {
      const auto part = part_of(b, c);
      if (is_cell(part) && sets_.is_root(part)) ++count[mesh_.blocks[b].materials[static_cast<std::size_t>(c)]];
    }
  }
  return count;
}

template class MeshComponents<2>;
template class MeshComponents<3>;
template class MeshComponents<4>;

}  // namespace treemarch
