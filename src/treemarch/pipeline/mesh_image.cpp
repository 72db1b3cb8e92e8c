#include "treemarch/pipeline/mesh_image.h"

#include <chrono>

#include "treemarch/pipeline/drop_material.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/prepare.h"

namespace treemarch {

template <int Dim>
MeshResult<Dim> mesh_image(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution) {
  const auto start = std::chrono::steady_clock::now();
  MeshResult<Dim> result;
  result.mesh = options.method == Method::paper ? mesh_by_paper(image, options, execution)
                                                : mesh_with_guarantee(image, options, execution);
  result.mesh.labels = image.labels;
  result.mesh.names = image.names;
  const MaterialId background = material_of(image.labels, options.background);
  if (!options.keep_background && background != kOutside) drop_material(result.mesh, background, execution);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

template MeshResult<2> mesh_image(const LabelImage<2>&, const MeshOptions&, Execution&);
template MeshResult<3> mesh_image(const LabelImage<3>&, const MeshOptions&, Execution&);

}  // namespace treemarch
