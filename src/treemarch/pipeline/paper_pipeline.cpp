#include <algorithm>
#include <functional>
#include <numeric>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/march/paper_march.h"
#include "treemarch/march/separate.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/sizing/assign_materials.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/smooth/smooth.h"
#include "treemarch/tessellate/leaf_shapes.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

constexpr int kPaperSmoothingSteps = 5;

/// Materials by the number of their voxels, the smallest last: an order that a mirrored image shares.
template <int Dim>
std::vector<MaterialId> by_voxels(const LabelImage<Dim>& image) {
  std::vector<std::int64_t> voxels(image.labels.size());
  image.voxels.visit([&](const auto* v) {
    for (std::int64_t i = 0; i < image.voxels.size(); ++i) ++voxels[v[i]];
  });
  std::vector<MaterialId> order(image.labels.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, std::greater<>(), [&](MaterialId m) { return voxels[m]; });
  return order;
}

template <int Dim>
PaperMarchOptions<Dim> march_options(const LabelImage<Dim>& image, const MeshOptions& options) {
  PaperMarchOptions<Dim> march;
  march.order = by_voxels(image);
  if (options.snap) march.snap = *options.snap;
  switch (options.field.value_or(FieldKind::solid_angle)) {
    case FieldKind::solid_angle:
      break;
    case FieldKind::linear:
      march.field = linear_field(image);
      break;
    default:
      throw Error(ErrorKind::usage, "--field: the paper's method takes solid-angle or linear");
  }
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
Mesh<Dim> mesh_by_paper(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution) {
  const PaperMarchOptions<Dim> march = march_options(image, options);
  const SizedLattice<Dim> sized = choose_lattice(image, parse_pattern<Dim>(options.pattern), options.sizes, execution);
  Spacetree<Dim> tree =
      build_spacetree<Dim>(sized.lattice, sized.pattern, required_levels(image, sized, options.sizes, execution),
                           options.balance, execution);
  assign_materials(tree, image, options.weights, execution);
  std::vector<LeafShape> shapes;
  if (options.elements == Elements::hybrid) shapes = hybrid_shapes(tree, execution);
  MidpointOptions tessellation;
  tessellation.shapes = shapes;
  Mesh<Dim> mesh = tessellate_midpoint(tree, tessellation, execution);
  tree = {};
  mesh.labels = image.labels;
  mesh.names = image.names;
  march_materials(mesh, march, execution);
  smooth(mesh, smooth_options(image, options), execution);
  return mesh;
}

template Mesh<2> mesh_by_paper(const LabelImage<2>&, const MeshOptions&, Execution&);
template Mesh<3> mesh_by_paper(const LabelImage<3>&, const MeshOptions&, Execution&);

}  // namespace treemarch
