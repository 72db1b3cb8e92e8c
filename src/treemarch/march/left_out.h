/// \file
/// The simplices of a lattice that a cut leaves out of its mesh.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// Where the simplices are that were left out: those of a leaf in `leaves` whose vertices are all in `vertices`.
struct LeftOutPlaces {
  Marks leaves{0}, vertices{0};
};

/// The far simplices of a material that the mesh will not keep: most of them nobody ever looks at. Those that someone
/// does need are added to the mesh as they are asked for. Refers to the lattice.
template <int Dim>
class LeftOutCells {
 public:
  using Simplex = std::array<VertexId, Dim + 1>;

  LeftOutCells(const SimplexLattice<Dim>& lattice, LeftOutPlaces places, MaterialId material)
      : lattice_(lattice), places_(std::move(places)), material_(material) {}

  /// Appends to the first block of the mesh, by leaves, those that have one of the vertices, but none twice.
  void append_at(Mesh<Dim>& mesh, const Marks& vertices, const Execution& execution);
  /// The same for those for which wanted(simplex) is true. \param wanted called from several threads
  void append_if(Mesh<Dim>& mesh, const std::function<bool(const Simplex&)>& wanted, const Execution& execution);

 private:
  template <class Concerns, class Wanted>
  void append(Mesh<Dim>& mesh, Concerns&& concerns, Wanted&& wanted, const Execution& execution);

  const SimplexLattice<Dim>& lattice_;
  const LeftOutPlaces places_;
  const MaterialId material_;
  std::vector<std::int64_t> appended_;  // leaf and number within its star, ascending
};

}  // namespace treemarch
