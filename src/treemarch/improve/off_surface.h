/// \file
/// Finds the vertices that the cut had to leave beside their interface.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/mesh/material_mark.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// The material of the cells around each vertex, or that there are several. Cells may be added from many threads: the
/// result does not depend on their order.
class MaterialsAround {
 public:
  explicit MaterialsAround(std::size_t vertices) : material_(vertices, kOutside) {}
  void add(VertexId v, MaterialId m) { note_material(material_[v], m); }
  [[nodiscard]] bool several(VertexId v) const { return material_[v] == kSeveral; }
  [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(material_.size()); }

 private:
  std::vector<MaterialId> material_;
};

/// Vertices between two or more materials where the two largest weights of the field differ by more than `tolerance`,
/// ascending. A weight changes by 0.5 to 1 over a voxel across an interface.
template <int Dim>
std::vector<VertexId> off_surface_vertices(const Points<Dim>& points, const MaterialsAround& around,
                                           const Field<Dim>& field, float tolerance, const Execution& execution);

}  // namespace treemarch
