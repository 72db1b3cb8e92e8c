#include "treemarch/mesh/interfaces.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

constexpr std::int64_t kFacetsPerPart = 1 << 14;

/// What one part of the facets contributes: by number of vertices, lines (2), triangles (3) and quads (4).
using PartBlocks = std::array<FacetBlock, 5>;

template <int Dim>
void add_facet(const Mesh<Dim>& mesh, const SharedFacet& shared, Hull hull, PartBlocks& out) {
  auto material = [&](const FacetSide& side) { return mesh.blocks[side.block].materials[side.cell]; };
  const FacetSide* inner = &shared.own;
  MaterialId first = material(shared.own);
  MaterialId second = kOutside;
  if (!shared.is_on_hull()) {
    second = material(shared.beyond);
    if (first == second) return;
    if (mesh.labels[second] < mesh.labels[first]) {
      std::swap(first, second);
      inner = &shared.beyond;
    }
  } else if (hull == Hull::leave_out) {
    return;
  }
  const CellBlock& block = mesh.blocks[inner->block];
  const LocalFacet& facet = topology(block.type).facets[inner->facet];
  FacetBlock& to = out[facet.size];
  for (int i = 0; i < facet.size; ++i) to.vertices.push_back(block.cell(inner->cell)[facet.vertex[i]]);
  to.first.push_back(first);
  to.second.push_back(second);
}

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

template <int Dim>
std::vector<FacetBlock> extract_interfaces(const Mesh<Dim>& mesh, Hull hull, const Execution& execution) {
  const Borders borders = find_borders(mesh, execution);
  const auto facets = std::ssize(borders.facets);
  std::vector<PartBlocks> parts(static_cast<std::size_t>(block_count(facets, kFacetsPerPart)));
  parallel_for(execution, std::ssize(parts), 1, [&](std::int64_t part) {
    for (std::int64_t i = part * kFacetsPerPart; i < std::min(facets, (part + 1) * kFacetsPerPart); ++i)
      add_facet(mesh, borders.facets[static_cast<std::size_t>(i)], hull, parts[static_cast<std::size_t>(part)]);
  });
  std::vector<FacetBlock> result;
  constexpr std::pair<int, CellType> kTypes[] = {{2, CellType::line}, {3, CellType::triangle}, {4, CellType::quad}};
  for (const auto& [size, type] : kTypes) {
    FacetBlock joined;
    joined.type = type;
    for (const PartBlocks& part : parts) {
      append(joined.vertices, part[size].vertices);
      append(joined.first, part[size].first);
      append(joined.second, part[size].second);
    }
    if (joined.size()) result.push_back(std::move(joined));
  }
  return result;
}

template std::vector<FacetBlock> extract_interfaces(const Mesh<2>&, Hull, const Execution&);
template std::vector<FacetBlock> extract_interfaces(const Mesh<3>&, Hull, const Execution&);

}  // namespace treemarch
