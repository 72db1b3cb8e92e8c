#include <algorithm>
#include <string>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/reference_cut.h"
#include "treemarch/pipeline/make_field.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/smooth/smooth.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

/// What distinguishes the references.
struct Reference {
  ReferencePlaces places;
  FieldKind field;  ///< where the options name none
  int samples;      ///< vertices a voxel and axis
  bool two_materials;
};

Reference reference_of(Method method) {
  switch (method) {
    case Method::nielson_sung:
      return {ReferencePlaces::equal_weights, FieldKind::linear, 1, true};
    case Method::bonnell:
      return {ReferencePlaces::equal_weights, FieldKind::gauss, 1, false};
    case Method::hege:
      return {ReferencePlaces::middle, FieldKind::linear, 2, false};
    default:
      return {ReferencePlaces::middle, FieldKind::linear, 1, false};
  }
}

/// The cells between `samples` vertices a voxel and axis, as an image: vertex i is at (i + 1/2) / samples voxels, cell
/// i between vertices i - 1 and i, the first and the last cell reach to the sides of the image. A cell is of a material
/// if all voxels are that have a say in the d-linear function at its vertices, else of one more material.
template <int Dim>
LabelImage<Dim> cells_between_samples(const LabelImage<Dim>& image, int samples, Execution& execution) {
  LabelImage<Dim> cells;
  cells.frame = image.frame;
  for (int d = 0; d < Dim; ++d) {
    cells.extent[d] = samples * image.extent[d] + 1;
    cells.frame.spacing[d] /= samples;
  }
  cells.labels = image.labels;
  cells.labels.push_back(0);
  const auto mixed = static_cast<MaterialId>(image.labels.size());
  cells.voxels = CompactArray(product(cells.extent), cells.labels.size());
  parallel_for(execution, cells.voxels.size(), 4096, [&](std::int64_t i) {
    const Coord<Dim> cell = coord_of(i, cells.extent);
    Coord<Dim> low, count;
    for (int d = 0; d < Dim; ++d) {
      // Of the voxels with centres around (cell - 1/2) / samples and (cell + 1/2) / samples; shifted to round down.
      const std::int32_t two = 2 * samples;
      const std::int32_t first = (2 * cell[d] - 1 - samples + two) / two - 1;
      const std::int32_t last = (2 * cell[d] + 1 - samples + two - 1) / two;
      low[d] = std::clamp(first, 0, image.extent[d] - 1);
      count[d] = std::clamp(last, 0, image.extent[d] - 1) - low[d] + 1;
    }
    const MaterialId material = image.material(low);
    bool same = true;
    for (std::int64_t k = 1; k < product(count) && same; ++k) {
      Coord<Dim> voxel = coord_of(k, count);
      for (int d = 0; d < Dim; ++d) voxel[d] += low[d];
      same = image.material(voxel) == material;
    }
    cells.voxels.set(i, same ? material : mixed);
  });
  return cells;
}

/// Sizes of the cells between samples: mixed ones are as small as any.
SizingRule sizes_between_samples(SizingRule rule, std::size_t materials, double smallest_spacing, int samples) {
  if (rule.min_size == 0) rule.min_size = smallest_spacing;
  rule.min_size /= samples;
  for (double& s : rule.material_interface_size) s /= samples;
  rule.material_size.resize(materials + 1, 0.0);
  rule.material_size.back() = rule.min_size;
  return rule;
}

/// Puts the mesh of the cells into the box of the image.
template <int Dim>
void fit_into_box(Mesh<Dim>& mesh, const LabelImage<Dim>& image, int samples, Execution& execution) {
  const Vec<Dim> size = image.size();
  parallel_for(execution, static_cast<std::int64_t>(mesh.points.size()), 4096, [&](std::int64_t v) {
    Vec<Dim>& x = mesh.points[static_cast<std::size_t>(v)];
    for (int d = 0; d < Dim; ++d) x[d] = std::clamp(x[d] - 0.5 * image.frame.spacing[d] / samples, 0.0, size[d]);
  });
}

void check(const Reference& reference, const MeshOptions& options, std::size_t materials) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorKind::usage, what + " with this --method; leave it out or choose --method paper");
  };
  if (options.snap) refuse("--snap: is not done");
  if (!options.weights.empty()) refuse("--weight: has no meaning");
  if (options.order != MaterialOrder::largest || !options.first.empty()) refuse("--order: has no meaning");
  if (options.elements != Elements::simplices) refuse("--elements: must be tet");
  if (!options.sizes.interface_size.empty()) refuse("--interface: has no meaning");
  if (options.sizes.tolerance > 0) refuse("--tolerance: is not looked at");
  if (options.sizes.layers > 0) refuse("--layers: is not looked at");
  if (!options.sizes.voxel_size.empty()) refuse("--region and --size-image: are not looked at");
  if (reference.two_materials && materials > 2)
    throw Error(ErrorKind::usage, "--method: nielson-sung separates two materials, the image has " +
                                      std::to_string(materials) + "; use --keep or --merge, or nielson-franke");
}

}  // namespace

template <int Dim>
Mesh<Dim> mesh_by_reference(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, const MeshOptions& options,
                            Execution& execution) {
  const Reference reference = reference_of(options.method);
  check(reference, options, image.labels.size());
  const Field<Dim> field = make_field(image, grey, field_kind(options, grey, reference.field), options, execution);
  const LabelImage<Dim> cells = cells_between_samples(image, reference.samples, execution);
  const SizingRule sizes = sizes_between_samples(options.sizes, image.labels.size(),
                                                 *std::ranges::min_element(image.frame.spacing), reference.samples);
  const SizedLattice<Dim> sized = choose_lattice(cells, parse_pattern<Dim>(options.pattern), sizes, execution);
  const Spacetree<Dim> tree = build_spacetree<Dim>(
      sized.lattice, sized.pattern, required_levels(cells, sized, sizes, execution), options.balance, execution);
  Mesh<Dim> lattice = tessellate_midpoint(tree, {}, execution);
  fit_into_box(lattice, image, reference.samples, execution);
  ReferenceReport report;
  Mesh<Dim> mesh = cut_by_reference(lattice, field, reference.places, image.labels, report, execution);
  lattice = {};
  SmoothOptions smoothing;
  smoothing.steps = options.smooth.value_or(0);
  smoothing.max_displacement = 0.5 * *std::ranges::min_element(image.frame.spacing);
  smooth(mesh, smoothing, execution);
  return mesh;
}

#define TREEMARCH_INSTANTIATE(DIM) \
  template Mesh<DIM> mesh_by_reference(const LabelImage<DIM>&, const GreyInput<DIM>*, const MeshOptions&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
