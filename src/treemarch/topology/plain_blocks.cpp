#include "treemarch/topology/plain_blocks.h"

#include <algorithm>
#include <atomic>
#include <tuple>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {

template <int Dim>
PlainBlocks<Dim>::PlainBlocks(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const Mesh<Dim>& mesh,
                              std::span<const BorderFacet> borders, const Execution& execution)
    : PlainBlocks(uniform) {
  constexpr double kSide = UniformBlocks<Dim>::kSide;
  constexpr double kSlack = 1e-3;  // voxels; far more than the tolerance of any test
  constexpr std::int64_t kWorth = 2;
  std::int64_t voxels = 0;
  for (std::int64_t b = 0; b < size(); ++b) voxels += uniform_[b] != UniformBlocks<Dim>::kMixed ? uniform.kVoxels : 0;
  if (voxels < kWorth * std::ssize(borders)) return;  // to look at the borders takes longer than at the voxels
  for (std::int64_t b = 0; b < size(); ++b)
    plain_[static_cast<std::size_t>(b)] = uniform_[b] != UniformBlocks<Dim>::kMixed;
  Vec<Dim> per_length;  // voxels
  for (int d = 0; d < Dim; ++d) per_length[d] = 1 / image.frame.spacing[d];
  // A border crosses a block if its box overlaps that of the centres of the voxels.
  parallel_for(execution, std::ssize(borders), 4096, [&](std::int64_t i) {
    const FacetSide& side = borders[static_cast<std::size_t>(i)].side;
    const CellBlock& block = mesh.blocks[side.block];
    const LocalFacet& facet = topology(block.type).facets[side.facet];
    const VertexId* cell = block.cell(side.cell);
    VoxelBox<Dim> box;
    for (int d = 0; d < Dim; ++d) {
      double low = mesh.points[cell[facet.vertex[0]]][d], high = low;
      for (int k = 1; k < facet.size; ++k) {
        const double x = mesh.points[cell[facet.vertex[static_cast<std::size_t>(k)]]][d];
        low = std::min(low, x);
        high = std::max(high, x);
      }
      std::tie(box.begin[d], box.end[d]) = whole_between((low * per_length[d] - kSlack + 0.5) / kSide - 1,
                                                         (high * per_length[d] + kSlack - 0.5) / kSide, extent()[d]);
      if (box.begin[d] >= box.end[d]) return;
    }
    for_each_row(box, extent(), [&](const Coord<Dim>&, std::int64_t at) {
      for (std::int64_t b = at; b < at + box.end[0] - box.begin[0]; ++b)
        std::atomic_ref(plain_[static_cast<std::size_t>(b)]).store(0, std::memory_order_relaxed);
    });
  });
}

template class PlainBlocks<2>;
template class PlainBlocks<3>;
template class PlainBlocks<4>;

}  // namespace treemarch
