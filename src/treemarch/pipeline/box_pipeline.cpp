#include <algorithm>
#include <vector>

#include "treemarch/pipeline/make_field.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/sizing/assign_materials.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/smooth/shift.h"
#include "treemarch/tessellate/leaf_shapes.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

/// Cells of one size, unless larger ones are asked for; where no size is given the voxels themselves.
template <int Dim>
SizedLattice<Dim> choose_boxes(const LabelImage<Dim>& image, const MeshOptions& options, SizingRule& rule,
                               const Execution& execution) {
  std::vector<Coord<Dim>> factors = parse_pattern<Dim>(options.pattern);
  const double voxel = *std::ranges::max_element(image.frame.spacing);
  if (rule.min_size == 0 && rule.max_size == 0 && factors.empty()) factors.assign(1, Coord<Dim>{}), factors[0].fill(2);
  if (rule.max_size == 0) rule.max_size = std::max(rule.min_size, voxel);
  return choose_lattice(image, factors, rule, execution);
}

}  // namespace

template <int Dim>
Mesh<Dim> mesh_by_boxes(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                        ShiftReport& report, Execution& execution) {
  SizingRule rule = options.sizes;
  const SizedLattice<Dim> sized = choose_boxes(image, options, rule, execution);
  Spacetree<Dim> tree = build_spacetree<Dim>(
      sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), options.balance, execution);
  assign_materials(tree, image, options.weights, execution);
  const std::vector<std::uint8_t> cut(tree.leaves.size(), 0);
  const std::vector<LeafShape> shapes = choose_leaf_shapes<Dim>(tree, cut, execution);
  MidpointOptions tessellation;
  tessellation.shapes = shapes;
  Mesh<Dim> mesh = tessellate_midpoint(tree, tessellation, execution);
  tree = {};
  mesh.labels = image.labels;
  mesh.names = image.names;
  if (options.shift == 0) return mesh;
  const Field<Dim> field = make_field(image, grey, field_kind(options, grey, FieldKind::dgf), options, execution);
  ShiftOptions shift;
  shift.most = options.shift;
  report = shift_vertices(mesh, field, shift, execution);
  return mesh;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                  \
  template Mesh<DIM> mesh_by_boxes(const LabelImage<DIM>&, const GreyInput<DIM>*, const MeshOptions&, ShiftReport&, \
                                   Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
