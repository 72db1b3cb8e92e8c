/// \file
/// Connected components of the materials of a mesh.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/core/vec.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/facets.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/disjoint_sets.h"

namespace treemarch {

/// A vertex of a mesh where a material touches itself: along an edge that four of its boundary's facets share, or in a
/// point only. The hull belongs to the boundary.
struct MeshPinch {
  VertexId vertex = 0;
  MaterialId material = 0;
  int sheets = 0;  ///< of its boundary beyond one, at least 1 (VertexLink::Excess)
};

/// A facet between cells of two materials, or of the hull.
struct BorderFacet {
  FacetSide side;       ///< one cell that has it
  MaterialId material;  ///< that of this cell
  MaterialId beyond;    ///< that of the other, kOutside on the hull
};

/// One cell of a mesh.
struct CellPlace {
  std::uint8_t block;  ///< index into Mesh::blocks
  std::int64_t cell;   ///< within its block
};

/// What is known of a mesh, so that less has to be looked at.
template <int Dim>
struct KnownOfMesh {
  std::optional<Vec<Dim>> fills;   ///< it fills the box from the origin to this corner
  std::int64_t uniform_cells = 0;  ///< so many first cells of block 0 have no vertex with a cell of another material
  /// One a vertex: 0 where all cells around it are of one material, for certain; empty where nothing is known.
  std::span<const std::uint8_t> at_interfaces;
  const Borders* borders = nullptr;  ///< its borders, if they are known; replaces all else
};

/// Components of the cells of each material, connected over facets, and where its boundary is no manifold. Refers to
/// the mesh, which must not change. \pre the mesh is sound (mesh/validate.h)
template <int Dim>
class MeshComponents {
 public:
  using Index = SharedDisjointSets::Index;
  /// Needs about 9 bytes a vertex and 6 a cell. The same for any number of threads.
  MeshComponents(const Mesh<Dim>& mesh, const Execution& execution, const KnownOfMesh<Dim>& known = {});

  /// The component of a cell: two cells are in one if and only if the numbers are equal. May be called from several
  /// threads.
  [[nodiscard]] Index of(std::size_t block, std::int64_t cell) const { return sets_.find(part_of(block, cell)); }
  /// Numbers of components are below this.
  [[nodiscard]] std::size_t index_end() const { return sets_.size(); }
  /// Whether all cells around a vertex are of one material and close around it.
  [[nodiscard]] bool is_inner(VertexId v) const { return border_[v] == kInside; }
  /// All cells without such a vertex, in their order.
  [[nodiscard]] const std::vector<CellPlace>& cells_at_borders() const { return cells_at_borders_; }
  /// Of the components of these cells those that have such a vertex elsewhere.
  [[nodiscard]] Marks with_inner_vertex(const Execution& execution) const;
  /// Components of each material.
  [[nodiscard]] std::vector<std::int64_t> count(const Execution& execution) const;
  /// All facets between two materials and of the hull, by their vertices in ascending order; where the mesh is known to
  /// fill a box, some of its hull may be missing.
  [[nodiscard]] const RawVector<BorderFacet>& facets() const { return facets_; }
  /// All pinches, by vertex, then by material; none are looked for in four dimensions.
  [[nodiscard]] const std::vector<MeshPinch>& pinches() const { return pinches_; }

 private:
  /// What is joined: inner vertices, which stand for the cells around them, and cells without an inner vertex. Of the
  /// vertices of a cell the smallest, so that the root of a component is the part of one of its cells.
  [[nodiscard]] Index part_of(std::size_t block, std::int64_t cell) const {
    const VertexId* v = mesh_.blocks[block].cell(cell);
    Index part = kNoVertex;
    for (int i = 0; i < vertex_count(mesh_.blocks[block].type); ++i)
      if (border_[v[i]] != kBorder) part = std::min(part, v[i]);
    return part != kNoVertex ? part : static_cast<Index>(first_cell_[block] + static_cast<std::size_t>(cell));
  }
  [[nodiscard]] bool is_cell(Index part) const { return part >= mesh_.points.size(); }
  void mark_borders(const Execution& execution);
  void mark_sides(const Vec<Dim>& far_corner, const Execution& execution);
  void join_uniform(const Execution& execution);
  void join_inside(const Execution& execution);
  void join_at_borders(const Execution& execution);
  void find_pinches(const Execution& execution) requires(Dim < 4);

  // Of a vertex.
  static constexpr std::uint8_t kInside = 0;  // all cells are of one material, and close around it
  static constexpr std::uint8_t kBorder = 1;  // neither
  static constexpr std::uint8_t kSide = 2;    // on the box; all cells are of one material, and connected over facets

  static constexpr VertexId kNoVertex = ~VertexId{0};

  const Mesh<Dim>& mesh_;
  const KnownOfMesh<Dim> known_;
  std::vector<std::uint8_t> border_;     // one a vertex
  std::vector<std::size_t> first_cell_;  // per block, numbered after the vertices
  SharedDisjointSets sets_;
  RawVector<MaterialId> material_of_part_;  // of inner vertices that are the part of some cell, else kUnused
  std::vector<CellPlace> cells_at_borders_;
  RawVector<BorderFacet> facets_;
  std::vector<MeshPinch> pinches_;
};

}  // namespace treemarch
