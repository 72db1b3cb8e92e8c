/// \file
/// The mesh that repeats an image voxel by voxel.
#pragma once

#include <array>

#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch::testing {

/// One quad or hexahedron a voxel.
template <int Dim>
Mesh<Dim> voxel_mesh(const LabelImage<Dim>& image) {
  static_assert(Dim == 2 || Dim == 3);
  Mesh<Dim> mesh;
  mesh.labels = image.labels;
  mesh.names = image.names;
  Coord<Dim> corners = image.extent;
  for (auto& c : corners) ++c;
  for (std::int64_t i = 0; i < product(corners); ++i) {
    const Coord<Dim> c = coord_of(i, corners);
    Vec<Dim> p;
    for (int d = 0; d < Dim; ++d) p[d] = c[d] * image.frame.spacing[d];
    mesh.points.push_back(p);
  }
  CellBlock block;
  block.type = Dim == 2 ? CellType::quad : CellType::hexahedron;
  for (std::int64_t i = 0; i < product(image.extent); ++i) {
    constexpr std::array<std::array<int, 3>, 8> kCorner{
        {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}};
    for (std::size_t k = 0; k < (Dim == 2 ? 4 : 8); ++k) {
      Coord<Dim> c = coord_of(i, image.extent);
      for (int d = 0; d < Dim; ++d) c[d] += kCorner[k][static_cast<std::size_t>(d)];
      block.vertices.push_back(static_cast<VertexId>(linear_index(c, corners)));
    }
    block.materials.push_back(image.voxels[i]);
  }
  mesh.blocks.push_back(std::move(block));
  return mesh;
}

}  // namespace treemarch::testing
