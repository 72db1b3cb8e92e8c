#include "treemarch/mesh/partition.h"

#include <metis.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/facets.h"

namespace treemarch {
namespace {

constexpr int kSeed = 1;

/// The cells beside each cell, as METIS wants them.
struct CellGraph {
  std::vector<idx_t> first, beside;
};

template <int Dim>
CellGraph graph_of(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::int64_t> first_cell;
  std::int64_t cells = 0;
  for (const CellBlock& block : mesh.blocks) {
    first_cell.push_back(cells);
    cells += block.size();
  }
  using Pair = std::pair<std::int64_t, std::int64_t>;
  std::vector<std::vector<Pair>> parts(
      static_cast<std::size_t>(facet_part_count(static_cast<std::int64_t>(mesh.points.size()))));
  visit_facets<Dim>(mesh, execution, [&](std::int64_t part, std::span<const FacetSide> sides) {
    if (sides.size() == 2)
      parts[static_cast<std::size_t>(part)].emplace_back(first_cell[sides[0].block] + sides[0].cell,
                                                         first_cell[sides[1].block] + sides[1].cell);
  });
  std::int64_t facets = 0;
  for (const auto& part : parts) facets += std::ssize(part);
  if (std::max(cells + 1, 2 * facets) > std::numeric_limits<idx_t>::max())
    throw Error(ErrorKind::limits, "--partitions: the mesh is larger than METIS counts; choose larger cells");

  CellGraph graph;
  graph.first.resize(static_cast<std::size_t>(cells) + 1);
  for (const auto& part : parts) {
    for (const auto& [a, b] : part) {
      ++graph.first[static_cast<std::size_t>(a)];
      ++graph.first[static_cast<std::size_t>(b)];
    }
  }
  graph.beside.resize(static_cast<std::size_t>(exclusive_scan(std::span(graph.first))));
  std::vector<idx_t> next(graph.first.begin(), graph.first.end() - 1);
  for (const auto& part : parts) {
    for (const auto& [a, b] : part) {
      graph.beside[static_cast<std::size_t>(next[static_cast<std::size_t>(a)]++)] = static_cast<idx_t>(b);
      graph.beside[static_cast<std::size_t>(next[static_cast<std::size_t>(b)]++)] = static_cast<idx_t>(a);
    }
  }
  return graph;
}

std::vector<std::int32_t> divide(CellGraph& graph, int parts) {
  idx_t cells = static_cast<idx_t>(graph.first.size()) - 1;
  idx_t constraints = 1;
  idx_t count = parts;
  idx_t cut = 0;
  std::array<idx_t, METIS_NOPTIONS> options{};
  METIS_SetDefaultOptions(options.data());
  options[METIS_OPTION_SEED] = kSeed;
  std::vector<idx_t> part(static_cast<std::size_t>(cells));
  // Bisection balances few parts better, k-way is faster for many; the limit is that of METIS's own programs.
  const auto run = parts <= 8 ? METIS_PartGraphRecursive : METIS_PartGraphKway;
  if (run(&cells, &constraints, graph.first.data(), graph.beside.data(), nullptr, nullptr, nullptr, &count, nullptr,
          nullptr, options.data(), &cut, part.data()) != METIS_OK)
    throw Error(ErrorKind::limits, "--partitions: METIS failed; is there enough memory?");
  return {part.begin(), part.end()};
}

}  // namespace

template <int Dim>
Partition partition_mesh(const Mesh<Dim>& mesh, int parts, Execution& execution) {
  const Execution::Stage stage(execution, "partition");
  if (parts < 2) throw Error(ErrorKind::usage, "--partitions: give 2 or more");
  if (parts > mesh.cell_count())
    throw Error(ErrorKind::usage, "--partitions: the mesh has only " + std::to_string(mesh.cell_count()) + " cells");
  CellGraph graph = graph_of(mesh, execution);
  Partition result;
  result.cell_part = divide(graph, parts);
  result.cells.resize(static_cast<std::size_t>(parts));
  for (const std::int32_t part : result.cell_part) ++result.cells[static_cast<std::size_t>(part)];
  std::int64_t sides = 0;
  for (std::size_t c = 0; c < result.cell_part.size(); ++c)
    for (idx_t i = graph.first[c]; i < graph.first[c + 1]; ++i)
      sides +=
          result.cell_part[c] != result.cell_part[static_cast<std::size_t>(graph.beside[static_cast<std::size_t>(i)])];
  result.facets_between = sides / 2;

  result.vertex_part.assign(mesh.points.size(), std::numeric_limits<std::int32_t>::max());
  std::vector<std::uint8_t> shared(mesh.points.size());
  std::size_t c = 0;
  for (const CellBlock& block : mesh.blocks) {
    for (std::int64_t i = 0; i < block.size(); ++i, ++c) {
      for (int k = 0; k < vertex_count(block.type); ++k) {
        const VertexId v = block.cell(i)[k];
        std::int32_t& owner = result.vertex_part[v];
        shared[v] |= owner != std::numeric_limits<std::int32_t>::max() && owner != result.cell_part[c];
        owner = std::min(owner, result.cell_part[c]);
      }
    }
  }
  result.vertices_between = std::count(shared.begin(), shared.end(), 1);
  return result;
}

template Partition partition_mesh(const Mesh<2>&, int, Execution&);
template Partition partition_mesh(const Mesh<3>&, int, Execution&);
template Partition partition_mesh(const Mesh<4>&, int, Execution&);

}  // namespace treemarch
