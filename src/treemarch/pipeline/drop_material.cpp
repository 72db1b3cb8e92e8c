#include "treemarch/pipeline/drop_material.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 16;

/// Moves what keeps(i) of each block of [0, n) to the front of the block, by move(from, to); then the blocks to the
/// front of all, by move_all(from, to, count), in order. Needs no second copy. \return how many are kept
template <class Keeps, class Move, class MoveAll>
std::int64_t keep_in_place(std::int64_t n, const Execution& execution, Keeps&& keeps, Move&& move, MoveAll&& move_all) {
  std::vector<std::int64_t> kept(static_cast<std::size_t>(block_count(n, kBlock)));
  parallel_for(execution, std::ssize(kept), 1, [&](std::int64_t b) {
    std::int64_t to = b * kBlock;
    for (std::int64_t i = to; i < std::min(n, (b + 1) * kBlock); ++i)
      if (keeps(i)) move(i, to++);
    kept[static_cast<std::size_t>(b)] = to - b * kBlock;
  });
  std::int64_t end = 0;
  for (std::int64_t b = 0; b < std::ssize(kept); ++b) {
    const std::int64_t count = kept[static_cast<std::size_t>(b)];
    if (end != b * kBlock) move_all(b * kBlock, end, count);
    end += count;
  }
  return end;
}

/// Keeps the cells that are not of a material, in their order.
void remove_cells(CellBlock& block, MaterialId material, const Execution& execution) {
  const auto width = static_cast<std::int64_t>(vertex_count(block.type));
  const auto vertices = block.vertices.begin();
  const auto materials = block.materials.begin();
  const std::int64_t kept = keep_in_place(
      block.size(), execution, [&](std::int64_t c) { return materials[c] != material; },
      [&](std::int64_t from, std::int64_t to) {
        materials[to] = materials[from];
        std::copy_n(vertices + from * width, width, vertices + to * width);
      },
      [&](std::int64_t from, std::int64_t to, std::int64_t count) {
        std::copy_n(materials + from, count, materials + to);
        std::copy_n(vertices + from * width, count * width, vertices + to * width);
      });
  block.vertices.resize(static_cast<std::size_t>(kept * width));
  block.materials.resize(static_cast<std::size_t>(kept));
}

}  // namespace

template <int Dim>
void drop_cells(Mesh<Dim>& mesh, MaterialId material, const Execution& execution) {
  for (CellBlock& block : mesh.blocks) remove_cells(block, material, execution);
  std::erase_if(mesh.blocks, [](const CellBlock& b) { return b.size() == 0; });
}

template <int Dim>
void drop_unused_points(Mesh<Dim>& mesh, const Execution& execution) {
  const std::int64_t n = std::ssize(mesh.points);
  std::vector<std::uint8_t> used(mesh.points.size());
  for (const CellBlock& block : mesh.blocks) {
    parallel_for(execution, std::ssize(block.vertices), kBlock, [&](std::int64_t i) {
      const std::atomic_ref mark(used[block.vertices[static_cast<std::size_t>(i)]]);
      if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
    });
  }
  const auto points = mesh.points.begin();
  const auto is_used = [&](std::int64_t v) { return used[static_cast<std::size_t>(v)] != 0; };
  const std::int64_t kept = keep_in_place(
      n, execution, is_used, [&](std::int64_t from, std::int64_t to) { points[to] = points[from]; },
      [&](std::int64_t from, std::int64_t to, std::int64_t count) { std::copy_n(points + from, count, points + to); });
  if (kept == n) return;
  mesh.points.resize(static_cast<std::size_t>(kept));
  std::vector<VertexId> number(used.begin(), used.end());
  exclusive_scan(std::span(number));
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
  drop_cells(mesh, material, execution);
  drop_unused_points(mesh, execution);
}

template void drop_cells(Mesh<2>&, MaterialId, const Execution&);
template void drop_cells(Mesh<3>&, MaterialId, const Execution&);
template void drop_unused_points(Mesh<2>&, const Execution&);
template void drop_unused_points(Mesh<3>&, const Execution&);
template void drop_material(Mesh<2>&, MaterialId, Execution&);
template void drop_material(Mesh<3>&, MaterialId, Execution&);
template void drop_material(Mesh<4>&, MaterialId, Execution&);

}  // namespace treemarch
