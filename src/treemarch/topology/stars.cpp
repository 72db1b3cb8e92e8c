#include "treemarch/topology/stars.h"

#include <algorithm>
#include <atomic>
#include <vector>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kVerticesPerPart = 4096;
constexpr std::int64_t kCellsPerTask = 8192;
constexpr std::uint64_t kEntriesPerPass = 12U << 20U;

/// Calls f(vertex, star cell) for every wanted vertex of every cell, in parallel.
template <int Dim, class F>
void for_each_corner(const Mesh<Dim>& mesh, std::span<const std::uint8_t> among, const Execution& execution, F&& f) {
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    const int n = vertex_count(block.type);
    parallel_for(execution, block.size(), kCellsPerTask, [&](std::int64_t c) {
      const VertexId* v = block.cell(c);
      for (int k = 0; k < n; ++k)
        if (among[v[k]] != 0) f(v[k], StarCell{static_cast<std::uint32_t>(c), static_cast<std::uint32_t>(b)});
    });
  }
}

}  // namespace

std::int64_t star_part_count(std::int64_t points) { return block_count(points, kVerticesPerPart); }

template <int Dim>
void visit_stars(const Mesh<Dim>& mesh, std::span<const std::uint8_t> among, const Execution& execution,
                 const std::function<void(std::int64_t, VertexId, std::span<const StarCell>)>& visit) {
  const auto points = static_cast<std::int64_t>(mesh.points.size());
  std::vector<std::uint32_t> count(mesh.points.size());
  for_each_corner(mesh, among, execution,
                  [&](VertexId v, StarCell) { std::atomic_ref(count[v]).fetch_add(1, std::memory_order_relaxed); });
  std::vector<StarCell> cells;
  for (std::int64_t begin = 0; begin < points;) {
    // Whole parts up to the memory of a pass, one at least.
    std::int64_t end = begin;
    std::uint64_t entries = 0;
    while (end < points && (end == begin || entries < kEntriesPerPass)) {
      const std::int64_t next = std::min(points, end + kVerticesPerPart);
      for (; end < next; ++end) entries += count[end];
    }
    std::vector<std::uint32_t> cursor(count.begin() + begin, count.begin() + end);
    cells.resize(exclusive_scan(std::span(cursor)));
    for_each_corner(mesh, among, execution, [&](VertexId v, StarCell c) {
      if (v < begin || v >= end) return;
      cells[std::atomic_ref(cursor[v - begin]).fetch_add(1, std::memory_order_relaxed)] = c;
    });
    // Each cursor now stands at the end of its star.
    parallel_for(execution, block_count(end - begin, kVerticesPerPart), 1, [&](std::int64_t p) {
      for (std::int64_t v = p * kVerticesPerPart; v < std::min(end - begin, (p + 1) * kVerticesPerPart); ++v) {
        const std::uint32_t size = count[begin + v];
        if (size == 0) continue;
        visit(begin / kVerticesPerPart + p, static_cast<VertexId>(begin + v),
              std::span<const StarCell>(cells).subspan(cursor[v] - size, size));
      }
    });
    begin = end;
  }
}

using Visitor = std::function<void(std::int64_t, VertexId, std::span<const StarCell>)>;
template void visit_stars(const Mesh<2>&, std::span<const std::uint8_t>, const Execution&, const Visitor&);
template void visit_stars(const Mesh<3>&, std::span<const std::uint8_t>, const Execution&, const Visitor&);

}  // namespace treemarch
