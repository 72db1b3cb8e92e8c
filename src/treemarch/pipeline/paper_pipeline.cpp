#include <algorithm>
#include <optional>
#include <vector>

#include "treemarch/march/paper_march.h"
#include "treemarch/march/separate.h"
#include "treemarch/pipeline/make_field.h"
#include "treemarch/pipeline/material_order.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/sizes.h"
#include "treemarch/sizing/assign_materials.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/smooth/smooth.h"
#include "treemarch/tessellate/leaf_shapes.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

constexpr int kPaperSmoothingSteps = 5;

template <int Dim>
PaperMarchOptions<Dim> march_options(const LabelImage<Dim>& image, const Field<Dim>* field,
                                     const MeshOptions& options) {
  PaperMarchOptions<Dim> march;
  march.order = material_order(image, options.order, options.first);
  if (options.snap) march.snap = *options.snap;
  if (field) march.field = against_the_rest(*field);
  return march;
}

/// Vertices stay within half a voxel of where the cut put them.
template <int Dim>
SmoothOptions smooth_options(const LabelImage<Dim>& image, const MeshOptions& options) {
  SmoothOptions smoothing;
  smoothing.steps = options.smooth.value_or(kPaperSmoothingSteps);
  smoothing.max_displacement = 0.5 * *std::ranges::min_element(image.frame.spacing);
  return smoothing;
}

/// Leaves stay whole where no vertex touches two materials: marching never comes there.
template <int Dim>
std::vector<LeafShape> hybrid_shapes(const Spacetree<Dim>& tree, const Execution& execution) {
  std::vector<MaterialId> material;
  material.reserve(tree.leaves.size());
  for (const Leaf<Dim>& leaf : tree.leaves) material.push_back(leaf.material);
  return choose_leaf_shapes<Dim>(tree, leaves_at_interfaces<Dim>(tree, material, execution), execution);
}

}  // namespace

template <int Dim>
Mesh<Dim> mesh_by_paper(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                        Execution& execution) {
  // Solid angles are taken on the mesh itself, all other functions by position.
  std::optional<Field<Dim>> field;
  const FieldKind kind = field_kind(options, grey, FieldKind::solid_angle);
  if (kind != FieldKind::solid_angle) field = make_field(image, grey, kind, options, execution);
  const SizingRule rule = complete_sizes(image, options, execution);
  const SizedLattice<Dim> sized = choose_lattice(image, parse_pattern<Dim>(options.pattern), rule, execution);
  Spacetree<Dim> tree = build_spacetree<Dim>(
      sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), options.balance, execution);
  assign_materials(tree, image, options.weights, execution);
  std::vector<LeafShape> shapes;
  if (options.elements == Elements::hybrid) shapes = hybrid_shapes(tree, execution);
  MidpointOptions tessellation;
  tessellation.shapes = shapes;
  tessellation.facets = options.facets;
  Mesh<Dim> mesh = tessellate_midpoint(tree, tessellation, execution);
  tree = {};
  mesh.labels = image.labels;
  mesh.names = image.names;
  march_materials(mesh, march_options(image, field ? &*field : nullptr, options), execution);
  field.reset();
  smooth(mesh, smooth_options(image, options), execution);
  return mesh;
}

#define TREEMARCH_INSTANTIATE(DIM) \
  template Mesh<DIM> mesh_by_paper(const LabelImage<DIM>&, const GreyInput<DIM>*, const MeshOptions&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
