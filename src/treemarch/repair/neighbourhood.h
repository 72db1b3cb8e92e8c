/// \file
/// Vertices near chosen ones.
#pragma once

#include <span>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/patch.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// A cell, and how far around it, in lengths of its longest edge.
struct Reach {
  CellId cell;
  double lengths;
};

/// Marks all vertices within reach of one of the cells, and maybe some a little further.
/// \pre as repair_topology()
template <int Dim>
void mark_near(const Mesh<Dim>& mesh, std::span<const Reach> cells, const LabelImage<Dim>& image, Marks& marked,
               const Execution& execution);

}  // namespace treemarch
