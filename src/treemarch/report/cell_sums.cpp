#include "treemarch/report/cell_sums.h"

#include <algorithm>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 13;  // cells a task

}  // namespace

template <int Dim>
std::vector<CellRange<Dim>> cell_ranges(const Mesh<Dim>& mesh) {
  std::vector<CellRange<Dim>> ranges;
  for (const CellBlock& block : mesh.blocks) {
    if (dimension(block.type) != Dim) continue;
    for (std::int64_t i = 0; i < block.size(); i += kBlock)
      ranges.push_back({&block, i, std::min(block.size(), i + kBlock)});
  }
  return ranges;
}

template <int Dim>
CellSums sum_cells(const Mesh<Dim>& mesh, const Execution& execution) {
  const auto ranges = cell_ranges(mesh);
  const std::size_t n = mesh.labels.size();
  // A few tables, each filled in order, whatever the number of threads.
  const std::int64_t group = block_count(static_cast<std::int64_t>(ranges.size()), 64);
  const std::int64_t groups = ranges.empty() ? 0 : block_count(static_cast<std::int64_t>(ranges.size()), group);
  std::vector<CellSums> partial(static_cast<std::size_t>(groups));
  parallel_for(execution, groups, 1, [&](std::int64_t g) {
    CellSums& sum = partial[static_cast<std::size_t>(g)];
    sum.cells.resize(n);
    sum.volume.resize(n);
    for (std::int64_t r = g * group; r < std::min<std::int64_t>(std::ssize(ranges), (g + 1) * group); ++r) {
      const CellRange<Dim>& range = ranges[static_cast<std::size_t>(r)];
      for (std::int64_t c = range.begin; c < range.end; ++c) {
        const MaterialId m = range.block->materials[static_cast<std::size_t>(c)];
        ++sum.cells[m];
        sum.volume[m] += cell_volume(mesh.points.data(), range.block->type, range.block->cell(c));
      }
    }
  });
  CellSums total{std::vector<std::int64_t>(n), std::vector<double>(n)};
  for (const CellSums& p : partial) {
    for (std::size_t m = 0; m < n; ++m) {
      total.cells[m] += p.cells[m];
      total.volume[m] += p.volume[m];
    }
  }
  return total;
}

template std::vector<CellRange<2>> cell_ranges(const Mesh<2>&);
template std::vector<CellRange<3>> cell_ranges(const Mesh<3>&);
template std::vector<CellRange<4>> cell_ranges(const Mesh<4>&);
template CellSums sum_cells(const Mesh<2>&, const Execution&);
template CellSums sum_cells(const Mesh<3>&, const Execution&);
template CellSums sum_cells(const Mesh<4>&, const Execution&);

}  // namespace treemarch
