/// \file
/// Shape of the cells: dihedral angles in 3D and 4D, angles in 2D.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/frame.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Smallest and largest of some angles, in degrees.
struct DegreeRange {
  double min = 180;
  double max = 0;
  void add(const DegreeRange& other) {
    min = std::min(min, other.min);
    max = std::max(max, other.max);
  }
  bool operator==(const DegreeRange&) const = default;
};

/// Dihedral angles of a tetrahedron, whatever its orientation. A flat one has 0 and 180, one with repeated points too.
[[nodiscard]] DegreeRange dihedral_angles(const std::array<Vec<3>, 4>& tetrahedron);

/// Angles of a triangle.
[[nodiscard]] DegreeRange triangle_angles(const std::array<Vec<2>, 3>& triangle);

/// Angles between the sides (2D) or dihedral angles between the facets (3D) of any cell, taken at its corners: exact
/// where the facets are flat. \pre points[v[i]] exists; dimension(type) == Dim.
template <int Dim>
[[nodiscard]] DegreeRange cell_angles(const Vec<Dim>* points, CellType type, const VertexId* v);

struct WorstCell {
  CellType type{};
  std::int64_t cell = 0;  ///< within the block of its type
  DegreeRange angles;
  Vec<3> centre{};  ///< mean of its vertices in the world; z = 0 in 2D, without the time in 4D
  std::int32_t label = 0;
};

/// How far the corners of the cells of one type are from right angles (mesh/cell_topology.h).
struct JacobianQuality {
  std::int64_t cells = 0;
  double min_scaled = 1, mean_scaled = 0;  ///< over the cells, of their scaled Jacobians
  double min_ratio = 1, mean_ratio = 0;    ///< of the smallest over the largest determinant within a cell
};

struct MeshQuality {
  DegreeRange angles;  ///< of all cells; {180, 0} where there are none
  /// Cells by their smallest and their largest angle, in bins of one degree.
  std::array<std::int64_t, 180> smallest{}, largest{};
  double mean_smallest = 0;                    ///< mean over the cells of their smallest angle
  std::array<JacobianQuality, 7> jacobians{};  ///< by type of cell, of those with several corners
  std::vector<WorstCell> worst;                ///< the cells with the smallest angles, worst first
};

/// True angles, that is those in the world: a sheared frame distorts them.
/// \param worst_count cells to list in MeshQuality::worst.
template <int Dim>
MeshQuality measure_quality(const Mesh<Dim>& mesh, const Frame<Dim>& frame, int worst_count,
                            const Execution& execution);

}  // namespace treemarch
