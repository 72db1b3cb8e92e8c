#include "treemarch/improve/off_surface.h"

#include <algorithm>
#include <array>
#include <atomic>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 14;
constexpr MaterialId kNone = kOutside, kSeveral = kOutside - 1;

/// The material of the cells around each vertex, kSeveral where there is more than one.
template <int Dim>
std::vector<MaterialId> materials_around(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<MaterialId> around(mesh.points.size(), kNone);
  const CellBlock& block = mesh.blocks[0];
  parallel_for_ranges(execution, block.size(), kBlock, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t c = begin; c < end; ++c)
      for (int k = 0; k <= Dim; ++k) {
        const std::atomic_ref<MaterialId> at(around[block.cell(c)[k]]);
        MaterialId seen = at.load(std::memory_order_relaxed);
        // Whatever the order of the threads, the last word is the only material or kSeveral.
        while (seen != block.materials[c] && seen != kSeveral)
          if (at.compare_exchange_weak(seen, seen == kNone ? block.materials[c] : kSeveral, std::memory_order_relaxed))
            break;
      }
  });
  return around;
}

}  // namespace

template <int Dim>
std::vector<VertexId> off_surface_vertices(const Mesh<Dim>& mesh, const Field<Dim>& field, float tolerance,
                                           const Execution& execution) {
  const std::vector<MaterialId> around = materials_around(mesh, execution);
  const auto n = static_cast<std::int64_t>(around.size());
  std::vector<std::vector<VertexId>> part(static_cast<std::size_t>(block_count(n, kBlock)));
  parallel_for(execution, static_cast<std::int64_t>(part.size()), 1, [&](std::int64_t b) {
    for (std::int64_t v = b * kBlock; v < std::min(n, (b + 1) * kBlock); ++v) {
      if (around[v] != kSeveral) continue;
      std::array<LabelWeight, 2> best;
      const int found = field.sample(mesh.points[v], best);
      if (found == 1 || best[0].weight - best[1].weight > tolerance) part[b].push_back(static_cast<VertexId>(v));
    }
  });
  std::vector<VertexId> all;
  for (const auto& some : part) all.insert(all.end(), some.begin(), some.end());
  return all;
}

template std::vector<VertexId> off_surface_vertices(const Mesh<2>&, const Field<2>&, float, const Execution&);
template std::vector<VertexId> off_surface_vertices(const Mesh<3>&, const Field<3>&, float, const Execution&);

}  // namespace treemarch
