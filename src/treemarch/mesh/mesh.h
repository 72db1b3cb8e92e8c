/// \file
/// A mesh as plain arrays.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "treemarch/core/raw_vector.h"
#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Index of a mesh vertex. More than 2^32 - 1 vertices are refused with ErrorKind::limits.
using VertexId = std::uint32_t;

/// Vertex order as in VTK. Simplices are positive: det(v1 - v0, ..., vd - v0) > 0. A pyramid's base 0123 is seen
/// counter-clockwise from its apex 4; a hexahedron has its bottom 0123 and its top 4567 above it.
enum class CellType : std::uint8_t { line, triangle, quad, tetrahedron, pyramid, hexahedron, pentatope };

[[nodiscard]] constexpr int vertex_count(CellType type) {
  constexpr int kCount[] = {2, 3, 4, 4, 5, 8, 5};
  return kCount[static_cast<int>(type)];
}

/// Topological dimension of a cell.
[[nodiscard]] constexpr int dimension(CellType type) {
  constexpr int kDimension[] = {1, 2, 2, 3, 3, 3, 4};
  return kDimension[static_cast<int>(type)];
}

/// The simplex of a dimension.
template <int Dim>
inline constexpr CellType kSimplex = Dim == 1   ? CellType::line
                                     : Dim == 2 ? CellType::triangle
                                     : Dim == 3 ? CellType::tetrahedron
                                                : CellType::pentatope;

/// All cells of one type.
struct CellBlock {
  CellType type{};
  RawVector<VertexId> vertices;     ///< vertex_count(type) a cell
  RawVector<MaterialId> materials;  ///< one a cell; an index into Mesh::labels

  [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(materials.size()); }
  [[nodiscard]] const VertexId* cell(std::int64_t i) const { return vertices.data() + i * vertex_count(type); }
};

/// A std::vector of points, where resize() does not set new ones.
template <int Dim>
using Points = RawVector<Vec<Dim>>;

/// A conforming mesh. Points are in the inner frame (image/frame.h).
template <int Dim>
struct Mesh {
  Points<Dim> points;
  std::vector<CellBlock> blocks;     ///< at most one of each type, in the order of CellType
  std::vector<std::int32_t> labels;  ///< the image's value of each material
  std::vector<std::string> names;    ///< as in LabelImage

  [[nodiscard]] std::int64_t cell_count() const {
    std::int64_t n = 0;
    for (const CellBlock& b : blocks) n += b.size();
    return n;
  }
};

/// Facets between two materials, or between one and the outside.
struct FacetBlock {
  CellType type{};  ///< line in 2D; triangle or quad in 3D
  std::vector<VertexId>
      vertices;  ///< seen counter-clockwise from the side of `second` (3D); positive normal to it (2D)
  /// Materials on the two sides, ordered by their label value, the smaller first; kOutside comes last.
  std::vector<MaterialId> first, second;

  [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(first.size()); }
};

}  // namespace treemarch
