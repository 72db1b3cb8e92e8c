#include "treemarch/mesh/borders.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/core/scramble.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/material_mark.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;

/// Not 0 where x is small.
std::uint64_t scatter(std::uint64_t x) { return scramble(x + 0x9e3779b97f4a7c15U); }

}  // namespace

template <int Dim>
void mark_interfaces(const Mesh<Dim>& mesh, std::int64_t first_cell, std::vector<std::uint8_t>& marks,
                     const Execution& execution) {
  RawVector<MaterialId> met = filled(execution, mesh.points.size(), kOutside);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    const std::int64_t first = b == 0 ? first_cell : 0;
    parallel_for(execution, block.size() - first, kCellsPerTask, [&](std::int64_t i) {
      const std::int64_t c = first + i;
      for (int k = 0; k < vertex_count(block.type); ++k)
        note_material(met[block.cell(c)[k]], block.materials[static_cast<std::size_t>(c)]);
    });
  }
  parallel_for(execution, std::ssize(met), 1 << 16, [&](std::int64_t v) {
    if (met[static_cast<std::size_t>(v)] == kSeveral) marks[static_cast<std::size_t>(v)] = 1;
  });
}

/// Each vertex adds up (xor) a hash of each of its facets. Those between two cells cancel.
template <int Dim>
void mark_hull(const Mesh<Dim>& mesh, std::int64_t first_cell, std::vector<std::uint8_t>& marks,
               const Execution& execution) {
  RawVector<std::uint64_t> sums = filled(execution, mesh.points.size(), std::uint64_t{0});
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    const CellTopology& shape = topology(block.type);
    const int n = vertex_count(block.type);
    const std::int64_t first = b == 0 ? first_cell : 0;
    parallel_for(execution, block.size() - first, kCellsPerTask, [&](std::int64_t c) {
      const VertexId* v = block.cell(first + c);
      bool any = false;
      for (int i = 0; i < n; ++i) any |= marks[v[i]] == 0;
      if (!any) return;
      std::array<std::uint64_t, 8> hash{}, sum{};
      for (int i = 0; i < n; ++i) hash[i] = scatter(v[i]);
      for (int k = 0; k < shape.facet_count; ++k) {
        const LocalFacet& facet = shape.facets[k];
        std::uint64_t h = 0;
        for (int i = 0; i < facet.size; ++i) h += hash[facet.vertex[i]];
        h = scatter(h);
        for (int i = 0; i < facet.size; ++i) sum[facet.vertex[i]] ^= h;
      }
      for (int i = 0; i < n; ++i)
        if (marks[v[i]] == 0) std::atomic_ref(sums[v[i]]).fetch_xor(sum[i], std::memory_order_relaxed);
    });
  }
  parallel_for(execution, std::ssize(sums), 1 << 16, [&](std::int64_t v) {
    if (sums[static_cast<std::size_t>(v)] != 0) marks[static_cast<std::size_t>(v)] = 1;
  });
}

template <int Dim>
Borders find_borders(const Mesh<Dim>& mesh, const Execution& execution) {
  Borders borders;
  borders.vertices.resize(mesh.points.size());
  mark_interfaces(mesh, 0, borders.vertices, execution);
  mark_hull(mesh, 0, borders.vertices, execution);
  std::vector<std::vector<SharedFacet>> found(
      static_cast<std::size_t>(facet_part_count(static_cast<std::int64_t>(mesh.points.size()))));
  visit_facets<Dim>(mesh, execution,
                    [&](std::int64_t part, std::span<const FacetSide> sides) {
                      found[static_cast<std::size_t>(part)].push_back(shared_facet(sides));
                    },
                    {borders.vertices});
  borders.facets = joined(execution, found);
  return borders;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                             \
  template void mark_interfaces(const Mesh<DIM>&, std::int64_t, std::vector<std::uint8_t>&, const Execution&); \
  template void mark_hull(const Mesh<DIM>&, std::int64_t, std::vector<std::uint8_t>&, const Execution&);       \
  template Borders find_borders(const Mesh<DIM>&, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
