#include "treemarch/pipeline/drop_material.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 16;

/// Keeps the cells that are not of a material, in their order.
CellBlock without(const CellBlock& block, MaterialId material, const Execution& execution) {
  const std::int64_t n = block.size();
  const auto width = static_cast<std::size_t>(vertex_count(block.type));
  std::vector<std::int64_t> first(static_cast<std::size_t>(block_count(n, kBlock)));
  const auto begin = block.materials.begin();
  parallel_for(execution, std::ssize(first), 1, [&](std::int64_t b) {
    const std::int64_t end = std::min(n, (b + 1) * kBlock);
    first[static_cast<std::size_t>(b)] = end - b * kBlock - std::count(begin + b * kBlock, begin + end, material);
  });
  const auto kept = static_cast<std::size_t>(exclusive_scan(std::span(first)));
  CellBlock result{block.type, std::vector<VertexId>(kept * width), std::vector<MaterialId>(kept)};
  parallel_for(execution, std::ssize(first), 1, [&](std::int64_t b) {
    auto to = static_cast<std::size_t>(first[static_cast<std::size_t>(b)]);
    for (std::int64_t c = b * kBlock; c < std::min(n, (b + 1) * kBlock); ++c) {
      const MaterialId m = block.materials[static_cast<std::size_t>(c)];
      if (m == material) continue;
      result.materials[to] = m;
      std::copy_n(block.cell(c), width, result.vertices.begin() + static_cast<std::ptrdiff_t>(to * width));
      ++to;
    }
  });
  return result;
}

}  // namespace

template <int Dim>
void drop_cells(Mesh<Dim>& mesh, MaterialId material, const Execution& execution) {
  for (CellBlock& block : mesh.blocks) block = without(block, material, execution);
  std::erase_if(mesh.blocks, [](const CellBlock& b) { return b.size() == 0; });
}

template <int Dim>
void drop_unused_points(Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<VertexId> number(mesh.points.size());
  for (const CellBlock& block : mesh.blocks) {
    parallel_for(execution, std::ssize(block.vertices), kBlock, [&](std::int64_t i) {
      std::atomic_ref(number[block.vertices[static_cast<std::size_t>(i)]]).store(1, std::memory_order_relaxed);
    });
  }
  const VertexId used = exclusive_scan(std::span(number));
  if (used == mesh.points.size()) return;
  for (std::size_t v = 0; v < number.size(); ++v) {
    const VertexId next = v + 1 < number.size() ? number[v + 1] : used;
    if (number[v] < next) mesh.points[number[v]] = mesh.points[v];  // moves towards the front only
  }
  mesh.points.resize(used);
  mesh.points.shrink_to_fit();
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
