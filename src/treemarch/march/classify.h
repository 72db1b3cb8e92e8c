/// \file
/// Step A of the default cut: which labels are tied at each lattice vertex.
#pragma once

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/march/label_sets.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// Labels whose weight is within this of the largest are tied.
inline constexpr float kTie = 1e-4F;

/// S(v) of every vertex: two labels on an interface, three on a junction curve, four at a junction point.
template <int Dim>
VertexLabels classify_vertices(const SimplexLattice<Dim>& lattice, const Field<Dim>& field, Execution& execution);

}  // namespace treemarch
