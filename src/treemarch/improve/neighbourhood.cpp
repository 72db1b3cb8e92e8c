#include "treemarch/improve/neighbourhood.h"

#include <algorithm>
#include <cmath>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kPerTask = 1 << 14;

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
  const auto voxel_at = [&](const Vec<Dim>& x) {
    Coord<Dim> c;
    for (int d = 0; d < Dim; ++d)
      c[d] =
          static_cast<std::int32_t>(std::clamp(std::floor(x[d] / image.frame.spacing[d]), 0.0, image.extent[d] - 1.0));
    return c;
  };
  Marks near(static_cast<std::size_t>(product(image.extent)));
  for (const Reach& reach : cells) {
    const Box<Dim> box = box_around(mesh, reach.cell, reach.lengths);
    const Coord<Dim> begin = voxel_at(box.low), last = voxel_at(box.high);
    Coord<Dim> count;
    for (int d = 0; d < Dim; ++d) count[d] = last[d] - begin[d] + 1;
    const std::int64_t rows = product(count) / count[0];
    for (std::int64_t row = 0; row < rows; ++row) {
      Coord<Dim> c = coord_of(row * count[0], count);
      for (int d = 0; d < Dim; ++d) c[d] += begin[d];
      const auto first = static_cast<std::size_t>(linear_index(c, image.extent));
      for (std::size_t i = 0; i < static_cast<std::size_t>(count[0]); ++i) near.mark(first + i);
    }
  }
  parallel_for(execution, std::ssize(mesh.points), kPerTask, [&](std::int64_t v) {
    const Coord<Dim> c = voxel_at(mesh.points[static_cast<std::size_t>(v)]);
    if (near[static_cast<std::size_t>(linear_index(c, image.extent))]) marked.mark(static_cast<std::size_t>(v));
  });
}

template void mark_near(const Mesh<2>&, std::span<const Reach>, const LabelImage<2>&, Marks&, const Execution&);
template void mark_near(const Mesh<3>&, std::span<const Reach>, const LabelImage<3>&, Marks&, const Execution&);

}  // namespace treemarch
