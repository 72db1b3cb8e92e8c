#include "treemarch/mesh/move_to_inner.h"

#include <algorithm>
#include <array>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/output_frame.h"

namespace treemarch {

template <int Dim>
void move_to_inner(Mesh<Dim>& mesh, const Frame<Dim>& frame, const Execution& execution) {
  const double det = determinant<Dim>(frame.direction);
  parallel_for(execution, std::ssize(mesh.points), 1 << 14, [&](std::int64_t i) {
    Vec<Dim>& x = mesh.points[static_cast<std::size_t>(i)];
    const Vec<Dim> offset = x - frame.origin;
    for (int c = 0; c < Dim; ++c) {  // Cramer's rule
      auto replaced = frame.direction;
      replaced[c] = offset;
      x[c] = determinant<Dim>(replaced) / det + 0.5 * frame.spacing[c];
    }
  });
  if (!is_left_handed(frame)) return;
  for (CellBlock& block : mesh.blocks) {
    const auto& order = mirrored_order(block.type);
    const auto n = static_cast<std::size_t>(vertex_count(block.type));
    for (std::size_t c = 0; c < block.materials.size(); ++c) {
      std::array<VertexId, 8> v{};
      std::copy_n(block.vertices.begin() + static_cast<std::ptrdiff_t>(c * n), n, v.begin());
      for (std::size_t k = 0; k < n; ++k) block.vertices[c * n + k] = v[order[k]];
    }
  }
}

template void move_to_inner(Mesh<2>&, const Frame<2>&, const Execution&);
template void move_to_inner(Mesh<3>&, const Frame<3>&, const Execution&);
template void move_to_inner(Mesh<4>&, const Frame<4>&, const Execution&);

}  // namespace treemarch
