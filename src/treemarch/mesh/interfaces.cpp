#include "treemarch/mesh/interfaces.h"

#include <array>
#include <cstdint>
#include <utility>

#include "treemarch/mesh/border_vertices.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/facets.h"

namespace treemarch {
namespace {

/// What one part of the facets contributes: by number of vertices, lines (2), triangles (3) and quads (4).
using PartBlocks = std::array<FacetBlock, 5>;

template <int Dim>
void add_facet(const Mesh<Dim>& mesh, std::span<const FacetSide> sides, Hull hull, PartBlocks& out) {
  auto material = [&](const FacetSide& side) { return mesh.blocks[side.block].materials[side.cell]; };
  const FacetSide* inner = &sides[0];
  MaterialId first = material(sides[0]);
  MaterialId second = kOutside;
  if (sides.size() > 1) {
    second = material(sides[1]);
    if (first == second) return;
    if (mesh.labels[second] < mesh.labels[first]) {
      std::swap(first, second);
      inner = &sides[1];
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
  std::vector<std::uint8_t> borders(mesh.points.size());
  mark_interfaces(mesh, 0, borders, execution);
  if (hull == Hull::include) mark_hull(mesh, 0, borders, execution);
  std::vector<PartBlocks> parts(facet_part_count(static_cast<std::int64_t>(mesh.points.size())));
  visit_facets<Dim>(
      mesh, execution,
      [&](std::int64_t part, std::span<const FacetSide> sides) { add_facet(mesh, sides, hull, parts[part]); },
      {borders});
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
