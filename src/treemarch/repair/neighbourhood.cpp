#include "treemarch/repair/neighbourhood.h"

#include <algorithm>
#include <array>
#include <bit>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kPerTask = 1 << 14;  // vertices
constexpr std::int64_t kBoxesPerTask = 512;
constexpr std::int32_t kStepsPerBox = 3;

template <int Dim>
struct Box {
  Vec<Dim> low, high;
};

/// The box around a cell, with a margin of some lengths of its longest edge.
template <int Dim>
Box<Dim> box_around(const Mesh<Dim>& mesh, CellId cell, double lengths) {
  const VertexId* v = mesh.blocks[0].cell(cell);
  Box<Dim> box{mesh.points[v[0]], mesh.points[v[0]]};
  double longest = 0;
  for (int i = 1; i <= Dim; ++i) {
    const Vec<Dim>& x = mesh.points[v[i]];
    for (int k = 0; k < i; ++k) longest = std::max(longest, norm(x - mesh.points[v[k]]));
    for (int d = 0; d < Dim; ++d) {
      box.low[d] = std::min(box.low[d], x[d]);
      box.high[d] = std::max(box.high[d], x[d]);
    }
  }
  for (int d = 0; d < Dim; ++d) {
    box.low[d] -= lengths * longest;
    box.high[d] += lengths * longest;
  }
  return box;
}

}  // namespace

/// Boxes around the cells are drawn on a raster of the voxels, and each vertex looks its place up.
template <int Dim>
void mark_near(const Mesh<Dim>& mesh, std::span<const Reach> cells, const LabelImage<Dim>& image, Marks& marked,
               const Execution& execution) {
  // Their corners are rounded outwards to a coarse raster, so that those of neighbouring cells are mostly the same.
  std::vector<std::array<Coord<Dim>, 2>> boxes(cells.size());
  parallel_for(execution, std::ssize(cells), kBoxesPerTask, [&](std::int64_t i) {
    const Reach& reach = cells[static_cast<std::size_t>(i)];
    const Box<Dim> box = box_around(mesh, reach.cell, reach.lengths);
    Coord<Dim> begin = image.voxel_at(box.low), last = image.voxel_at(box.high);
    for (int d = 0; d < Dim; ++d) {
      const auto step = static_cast<std::int32_t>(
          std::bit_floor(static_cast<std::uint32_t>(std::max(1, (last[d] - begin[d]) / kStepsPerBox))));
      begin[d] -= begin[d] % step;
      last[d] = std::min(last[d] - last[d] % step + step, image.extent[d]) - 1;
    }
    boxes[static_cast<std::size_t>(i)] = {begin, last};
  });
  parallel_sort(execution, boxes);
  boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
  Marks near(static_cast<std::size_t>(product(image.extent)));
  parallel_for(execution, std::ssize(boxes), kBoxesPerTask, [&](std::int64_t i) {
    const auto& [begin, last] = boxes[static_cast<std::size_t>(i)];
    Coord<Dim> count;
    for (int d = 0; d < Dim; ++d) count[d] = last[d] - begin[d] + 1;
    const std::int64_t rows = product(count) / count[0];
    for (std::int64_t row = 0; row < rows; ++row) {
      Coord<Dim> c = coord_of(row * count[0], count);
      for (int d = 0; d < Dim; ++d) c[d] += begin[d];
      near.mark_run(static_cast<std::size_t>(linear_index(c, image.extent)), static_cast<std::size_t>(count[0]));
    }
  });
  parallel_for(execution, std::ssize(mesh.points), kPerTask, [&](std::int64_t v) {
    const Coord<Dim> c = image.voxel_at(mesh.points[static_cast<std::size_t>(v)]);
    if (near[static_cast<std::size_t>(linear_index(c, image.extent))]) marked.mark(static_cast<std::size_t>(v));
  });
}

template void mark_near(const Mesh<2>&, std::span<const Reach>, const LabelImage<2>&, Marks&, const Execution&);
template void mark_near(const Mesh<3>&, std::span<const Reach>, const LabelImage<3>&, Marks&, const Execution&);

}  // namespace treemarch
