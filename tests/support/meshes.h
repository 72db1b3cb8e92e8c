/// \file
/// Meshes with known properties, for the tests of stages that read one.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <numeric>
#include <vector>

#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch::testing {

/// A grid of boxes, each split into Dim! simplices along its main diagonal (Kuhn): conforming, positive, fills the box
/// [0, extent * unit]. label(cell) gives the value of each grid cell.
template <int Dim>
Mesh<Dim> box_mesh(const Coord<Dim>& extent, const std::function<std::int32_t(const Coord<Dim>&)>& label,
                   const Vec<Dim>& unit = Frame<Dim>::filled(1.0)) {
  Mesh<Dim> mesh;
  Coord<Dim> lattice = extent;
  for (auto& n : lattice) ++n;
  mesh.points.resize(product(lattice));
  for (std::int64_t i = 0; i < product(lattice); ++i) {
    const Coord<Dim> c = coord_of(i, lattice);
    for (int d = 0; d < Dim; ++d) mesh.points[i][d] = c[d] * unit[d];
  }

  std::vector<std::int32_t> values(product(extent));
  for (std::int64_t i = 0; i < product(extent); ++i) values[i] = label(coord_of(i, extent));
  const LabelImage<Dim> image = make_label_image(extent, values, Frame<Dim>{});
  mesh.labels = image.labels;

  CellBlock block;
  block.type = kSimplex<Dim>;
  for (std::int64_t i = 0; i < product(extent); ++i) {
    std::array<int, Dim> axes;
    std::iota(axes.begin(), axes.end(), 0);
    do {
      std::array<VertexId, Dim + 1> v;
      Coord<Dim> c = coord_of(i, extent);
      v[0] = static_cast<VertexId>(linear_index(c, lattice));
      for (int k = 0; k < Dim; ++k) {
        ++c[axes[k]];
        v[k + 1] = static_cast<VertexId>(linear_index(c, lattice));
      }
      if (simplex_determinant<Dim>(mesh.points.data(), v.data()) < 0) std::swap(v[0], v[1]);
      block.vertices.insert(block.vertices.end(), v.begin(), v.end());
      block.materials.push_back(image.voxels[i]);
    } while (std::next_permutation(axes.begin(), axes.end()));
  }
  mesh.blocks.push_back(std::move(block));
  return mesh;
}

/// Facets between materials as points, whatever the numbering.
template <int Dim>
std::vector<std::vector<Vec<Dim>>> interfaces_of(const Mesh<Dim>& mesh, Hull hull = Hull::leave_out) {
  std::vector<std::vector<Vec<Dim>>> facets;
  for (const FacetBlock& block : extract_interfaces(mesh, hull, Execution(1))) {
    const int corners = vertex_count(block.type);
    for (std::int64_t i = 0; i < block.size(); ++i) {
      std::vector<Vec<Dim>> facet;
      for (int k = 0; k < corners; ++k) facet.push_back(mesh.points[block.vertices[i * corners + k]]);
      std::ranges::sort(facet);
      facets.push_back(facet);
    }
  }
  std::ranges::sort(facets);
  return facets;
}

/// One hexahedron at the bottom, pyramids on a midpoint above it, the gaps filled by tetrahedra: every type of cell in
/// the box [0,1] x [0,1] x [0,2]. Labels: hexahedron 1, pyramids 2, tetrahedra 3.
inline Mesh<3> mixed_mesh() {
  Mesh<3> mesh;
  for (int z = 0; z < 3; ++z)
    for (auto [x, y] : {std::array{0., 0.}, {1., 0.}, {1., 1.}, {0., 1.}}) mesh.points.push_back({x, y, 1. * z});
  mesh.points.push_back({0.5, 0.5, 1.5});
  mesh.labels = {1, 2, 3};
  CellBlock tets{CellType::tetrahedron, {}, {}};
  // The top is cut along 8-10, the sides along the diagonal from their lower first corner.
  for (auto [a, b, c] : {std::array<VertexId, 3>{8, 9, 10}, {8, 10, 11}}) {
    tets.vertices.insert(tets.vertices.end(), {a, c, b, 12});
    tets.materials.push_back(2);
  }
  CellBlock pyramids{CellType::pyramid, {4, 5, 6, 7, 12}, {1}};
  for (VertexId i = 0; i < 4; ++i) {
    const VertexId a = 4 + i, b = 4 + (i + 1) % 4;
    if (i % 2 == 0) {
      pyramids.vertices.insert(pyramids.vertices.end(), {a, a + 4, b + 4, b, 12});
      pyramids.materials.push_back(1);
    } else {
      tets.vertices.insert(tets.vertices.end(), {a, b + 4, b, 12, a, a + 4, b + 4, 12});
      tets.materials.insert(tets.materials.end(), {2, 2});
    }
  }
  CellBlock hexahedra{CellType::hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}, {0}};
  mesh.blocks = {std::move(tets), std::move(pyramids), std::move(hexahedra)};
  return mesh;
}

/// Whether two meshes hold the same in the same order.
template <int Dim>
bool same_mesh(const Mesh<Dim>& a, const Mesh<Dim>& b) {
  return a.points == b.points && a.labels == b.labels && a.names == b.names &&
         std::equal(a.blocks.begin(), a.blocks.end(), b.blocks.begin(), b.blocks.end(),
                    [](const CellBlock& x, const CellBlock& y) {
                      return x.type == y.type && x.vertices == y.vertices && x.materials == y.materials;
                    });
}

}  // namespace treemarch::testing
