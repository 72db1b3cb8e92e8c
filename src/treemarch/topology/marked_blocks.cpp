#include "treemarch/topology/marked_blocks.h"

#include <algorithm>
#include <atomic>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {

template <int Dim>
MarkedBlocks<Dim>::MarkedBlocks(const LabelImage<Dim>& image, const ComponentMap& map,
                                std::span<const std::uint8_t> wanted, const Execution& execution)
    : image_(image) {
  constexpr std::int64_t kRowsPerTask = 256;
  constexpr int kShift = UniformBlocks<Dim>::kShift;
  extent_ = blocks_around(VoxelBox<Dim>{{}, image.extent}).end;
  marks_.assign(static_cast<std::size_t>(product(extent_)), 0);
  if (std::ranges::count(wanted, 0) == std::ssize(wanted)) return;
  parallel_for(execution, std::ssize(map.row_begin) - 1, kRowsPerTask, [&](std::int64_t row) {
    const Coord<Dim> block = UniformBlocks<Dim>::block_of(coord_of(row * map.width, image.extent));
    std::uint8_t* const of_row = marks_.data() + linear_index(block, extent_);
    map.for_runs(static_cast<std::size_t>(row), [&](std::int64_t begin, std::int64_t end, std::uint32_t component) {
      if (wanted[component] == 0) return;
      for (std::int64_t b = begin >> kShift; b <= (end - 1) >> kShift; ++b)
        std::atomic_ref(of_row[b]).store(1, std::memory_order_relaxed);
    });
  });
}

template <int Dim>
bool MarkedBlocks<Dim>::touch(const Mesh<Dim>& mesh, const CellBlock& cells, std::int64_t begin,
                              std::int64_t end) const {
  constexpr double kSlack = 1e-3;  // voxels; far more than the tolerance of any test
  if (begin >= end) return false;
  const std::int64_t width = vertex_count(cells.type);
  Vec<Dim> low = mesh.points[cells.cell(begin)[0]], high = low;
  for (const VertexId v : std::span(cells.vertices).subspan(begin * width, (end - begin) * width))
    for (int d = 0; d < Dim; ++d) {
      low[d] = std::min(low[d], mesh.points[v][d]);
      high[d] = std::max(high[d], mesh.points[v][d]);
    }
  Vec<Dim> per_length;  // voxels
  for (int d = 0; d < Dim; ++d) per_length[d] = 1 / image_.frame.spacing[d];
  const VoxelBox<Dim> box = centres_between(low, high, per_length, image_.extent, kSlack);
  if (box.is_empty()) return false;
  const VoxelBox<Dim> blocks = blocks_around(box);
  bool any = false;
  for_each_row(blocks, extent_, [&](const Coord<Dim>&, std::int64_t at) {
    any = any || std::ranges::any_of(std::span(marks_).subspan(at, blocks.end[0] - blocks.begin[0]),
                                     [](std::uint8_t mark) { return mark != 0; });
  });
  return any;
}

template class MarkedBlocks<2>;
template class MarkedBlocks<3>;

}  // namespace treemarch
