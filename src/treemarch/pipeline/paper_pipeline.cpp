#include "treemarch/pipeline/methods.h"

namespace treemarch {

template <int Dim>
Mesh<Dim> mesh_by_paper(const LabelImage<Dim>&, const MeshOptions&, Execution&) {
  return {};
}

template Mesh<2> mesh_by_paper(const LabelImage<2>&, const MeshOptions&, Execution&);
template Mesh<3> mesh_by_paper(const LabelImage<3>&, const MeshOptions&, Execution&);

}  // namespace treemarch
