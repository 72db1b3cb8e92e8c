#include "treemarch/pipeline/drop_material.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/core/raw_vector.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 13;

/// Moves what keeps(i) of [0, n) to the front, in order, by move(from, to). Needs no second copy: blocks move at the
/// same time where they stay in place, or where their new places were all left by blocks before them.
/// \return how many are kept
template <class Keeps, class Move>
std::int64_t keep_in_place(std::int64_t n, const Execution& execution, Keeps&& keeps, Move&& move) {
  const std::int64_t blocks = block_count(n, kBlock);
  std::vector<std::int64_t> first(static_cast<std::size_t>(blocks) + 1);  // new place of what each block keeps
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    std::int64_t kept = 0;
    for (std::int64_t i = b * kBlock; i < std::min(n, (b + 1) * kBlock); ++i) kept += keeps(i) ? 1 : 0;
    first[static_cast<std::size_t>(b)] = kept;
  });
  const std::int64_t total = exclusive_scan(std::span(first));
  const auto new_begin = [&](std::int64_t block) { return first[static_cast<std::size_t>(block)]; };
  for (std::int64_t begin = 0, end = 0; begin < blocks; begin = end) {
    end = begin + 1;
    while (end < blocks && (new_begin(end) == end * kBlock || new_begin(end + 1) <= begin * kBlock)) ++end;
    parallel_for(execution, end - begin, 1, [&](std::int64_t k) {
      const std::int64_t b = begin + k;
      std::int64_t to = new_begin(b);
      for (std::int64_t i = b * kBlock; i < std::min(n, (b + 1) * kBlock); ++i)
        if (keeps(i)) move(i, to++);
    });
  }
  return total;
}

/// Keeps the cells that are not of a material, in their order, with number(v) for each vertex v.
template <class Number>
void remove_cells(CellBlock& block, MaterialId material, const Execution& execution, Number&& number) {
  const auto width = static_cast<std::int64_t>(vertex_count(block.type));
  const auto vertices = block.vertices.begin();
  const auto materials = block.materials.begin();
  const std::int64_t kept = keep_in_place(
      block.size(), execution, [&](std::int64_t c) { return materials[c] != material; },
      [&](std::int64_t from, std::int64_t to) {
        materials[to] = materials[from];
        for (std::int64_t k = 0; k < width; ++k) vertices[to * width + k] = number(vertices[from * width + k]);
      });
  block.vertices.resize(static_cast<std::size_t>(kept * width));
  block.materials.resize(static_cast<std::size_t>(kept));
}

/// Marks the vertices of the cells that are not of a material.
void mark_used(const CellBlock& block, MaterialId material, std::vector<std::uint8_t>& used,
               const Execution& execution) {
  const int width = vertex_count(block.type);
  parallel_for(execution, block.size(), kBlock, [&](std::int64_t c) {
    if (block.materials[static_cast<std::size_t>(c)] == material) return;
    for (const VertexId v : std::span(block.cell(c), static_cast<std::size_t>(width))) {
      const std::atomic_ref mark(used[v]);
      if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
    }
  });
}

/// Takes the points that are not used out of a mesh. \return the new number of each point, nothing if all are used
template <int Dim>
RawVector<VertexId> remove_points(Mesh<Dim>& mesh, const std::vector<std::uint8_t>& used, const Execution& execution) {
  const std::int64_t n = std::ssize(mesh.points);
  const auto points = mesh.points.begin();
  RawVector<VertexId> number(mesh.points.size());
  const std::int64_t kept = keep_in_place(
      n, execution, [&](std::int64_t v) { return used[static_cast<std::size_t>(v)] != 0; },
      [&](std::int64_t from, std::int64_t to) {
        points[to] = points[from];
        number[static_cast<std::size_t>(from)] = static_cast<VertexId>(to);
      });
  mesh.points.resize(static_cast<std::size_t>(kept));
  if (kept == n) number.clear();
  return number;
}

template <int Dim>
void drop_empty_blocks(Mesh<Dim>& mesh) {
  std::erase_if(mesh.blocks, [](const CellBlock& b) { return b.size() == 0; });
}

}  // namespace

template <int Dim>
void drop_cells(Mesh<Dim>& mesh, MaterialId material, const Execution& execution) {
  for (CellBlock& block : mesh.blocks) remove_cells(block, material, execution, [](VertexId v) { return v; });
  drop_empty_blocks(mesh);
}

template <int Dim>
void drop_unused_points(Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::uint8_t> used(mesh.points.size());
  for (const CellBlock& block : mesh.blocks) mark_used(block, kOutside, used, execution);
  const RawVector<VertexId> number = remove_points(mesh, used, execution);
  if (number.empty()) return;
  for (CellBlock& block : mesh.blocks) {
    parallel_for(execution, std::ssize(block.vertices), kBlock, [&](std::int64_t i) {
      VertexId& v = block.vertices[static_cast<std::size_t>(i)];
      v = number[v];
    });
  }
}

template <int Dim>
void drop_material(Mesh<Dim>& mesh, MaterialId material, Execution& execution) {
  const Execution::Stage stage(execution, "drop background");
  std::vector<std::uint8_t> used(mesh.points.size());
  for (const CellBlock& block : mesh.blocks) mark_used(block, material, used, execution);
  const RawVector<VertexId> number = remove_points(mesh, used, execution);
  for (CellBlock& block : mesh.blocks)
    remove_cells(block, material, execution, [&](VertexId v) { return number.empty() ? v : number[v]; });
  drop_empty_blocks(mesh);
}

template void drop_cells(Mesh<2>&, MaterialId, const Execution&);
template void drop_cells(Mesh<3>&, MaterialId, const Execution&);
template void drop_unused_points(Mesh<2>&, const Execution&);
template void drop_unused_points(Mesh<3>&, const Execution&);
template void drop_material(Mesh<2>&, MaterialId, Execution&);
template void drop_material(Mesh<3>&, MaterialId, Execution&);
template void drop_material(Mesh<4>&, MaterialId, Execution&);

}  // namespace treemarch
