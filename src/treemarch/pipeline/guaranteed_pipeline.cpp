#include "treemarch/core/error.h"
#include "treemarch/pipeline/methods.h"

namespace treemarch {

template <int Dim>
Mesh<Dim> mesh_with_guarantee(const LabelImage<Dim>&, const MeshOptions&, Execution&) {
  throw Error(ErrorKind::usage, "--method: guaranteed is not part of this version; choose paper");
}

template Mesh<2> mesh_with_guarantee(const LabelImage<2>&, const MeshOptions&, Execution&);
template Mesh<3> mesh_with_guarantee(const LabelImage<3>&, const MeshOptions&, Execution&);

}  // namespace treemarch
