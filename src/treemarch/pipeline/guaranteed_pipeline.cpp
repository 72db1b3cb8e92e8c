#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/fit.h"
#include "treemarch/improve/improve.h"
#include "treemarch/march/cut.h"
#include "treemarch/march/quality_floor.h"
#include "treemarch/march/whole_cells.h"
#include "treemarch/pipeline/drop_material.h"
#include "treemarch/pipeline/make_field.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/prepare.h"
#include "treemarch/pipeline/preserve_volume.h"
#include "treemarch/pipeline/sizes.h"
#include "treemarch/repair/repair_topology.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

constexpr double kFloorWithinStretch = 18;  // proved for every lattice up to kMostStretch
constexpr double kFarQuality = 40;   // of uncut simplices of such lattices, at least; 45 to 120 degrees without stretch
constexpr int kPadding = 3;          // voxels around the image for a closed border
constexpr double kLeftToFit = 1.25;  // voxels: vertices with longer edges on average have facets that are fitted

/// Whether interfaces have cells of more than a voxel anywhere: facets of smaller ones need no fit.
bool is_coarse(const SizingRule& rule, double voxel) {
  double largest = rule.min_size;
  for (const double s : rule.material_interface_size) largest = std::max(largest, s);
  for (const auto& i : rule.interface_size) largest = std::max(largest, i.size);
  return largest > voxel * kSizeTolerance;
}

/// Sizes of the voxels of an image for the padded one, where nothing is asked of the layer around it.
template <int Dim>
std::vector<float> padded_sizes(const std::vector<float>& sizes, const Coord<Dim>& extent, const Coord<Dim>& larger) {
  std::vector<float> result(static_cast<std::size_t>(product(larger)), 0);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    Coord<Dim> c = coord_of(static_cast<std::int64_t>(i), extent);
    for (int d = 0; d < Dim; ++d) c[d] += kPadding;
    result[static_cast<std::size_t>(linear_index(c, larger))] = sizes[i];
  }
  return result;
}

/// The image with a layer of background around it, so that nothing else touches its sides.
template <int Dim>
LabelImage<Dim> padded(const LabelImage<Dim>& image, std::int32_t background) {
  Coord<Dim> extent = image.extent;
  for (int d = 0; d < Dim; ++d) extent[d] += 2 * kPadding;
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)), background);
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    Coord<Dim> c = coord_of(i, image.extent);
    for (int d = 0; d < Dim; ++d) c[d] += kPadding;
    values[static_cast<std::size_t>(linear_index(c, extent))] = image.labels[image.voxels[i]];
  }
  return make_label_image(extent, values, image.frame);
}

/// From the padded image back to the given one: its inner frame and its materials.
template <int Dim>
void restore_place(Mesh<Dim>& mesh, const LabelImage<Dim>& padded_image, const LabelImage<Dim>& image) {
  for (Vec<Dim>& p : mesh.points)
    for (int d = 0; d < Dim; ++d) p[d] -= kPadding * image.frame.spacing[d];
  std::vector<MaterialId> material(padded_image.labels.size());
  for (std::size_t m = 0; m < material.size(); ++m) material[m] = material_of(image.labels, padded_image.labels[m]);
  for (CellBlock& block : mesh.blocks)
    for (MaterialId& m : block.materials) m = material[m];
}

/// The floor in force: as asked, or what is proved for cells of these sides.
template <int Dim>
double quality_floor(const Lattice<Dim>& lattice, double asked, Execution& execution) {
  if (stretch(lattice) <= kMostStretch && asked <= kFloorWithinStretch) return asked;
  constexpr double kRounding = 1e-6;  // degrees
  const double proved = guaranteed_quality(lattice.unit) - kRounding;
  if (asked <= proved) return asked;
  char text[200];
  std::snprintf(
      text, sizeof text,
      "--min-size: cells of this size fill the box only when stretched by %.3f; angles are at least %.1f degrees "
      "after the cut, not %.1f; choose smaller cells",
      stretch(lattice), proved, asked);
  execution.warn(text);
  return proved;
}

/// What the stages after the lattice need to know.
template <int Dim>
struct Shaping {
  const LabelImage<Dim>& image;
  const MeshOptions& options;
  MaterialId left_out;  ///< the background where it is not part of the mesh, else kOutside
  bool coarse;          ///< whether facets are so large that they need to be fitted
  bool cubic;           ///< whether cells are cubes up to kMostStretch
};

/// From a lattice and a field to the mesh, and to its borders if they are found on the way.
template <int Dim>
Mesh<Dim> shape_mesh(const Shaping<Dim>& how, SimplexLattice<Dim>& lattice, bool last, const Field<Dim>& field,
                     GuaranteeReport& report, std::optional<Borders>& borders, Execution& execution) {
  std::optional<Execution::Stage> stage;
  stage.emplace(execution, "cut");
  CutOptions cut;
  cut.quality_floor = report.quality_floor;
  cut.left_out = how.left_out;
  Mesh<Dim> mesh = cut_lattice(lattice, field, how.image.labels, cut, report.cut, execution);
  const bool hybrid = how.options.elements == Elements::hybrid;

  stage.emplace(execution, "topology");
  RepairOptions repair;
  repair.min_component = how.options.min_component;
  repair.left_out = how.left_out;
  repair.uniform_cells = report.cut.far_cells;
  repair.at_interfaces = report.cut.at_interfaces;
  LeftOutCells<Dim> left_out(lattice, std::move(report.cut.left_out), how.left_out);
  report.repair = repair_topology(mesh, how.image, repair, execution, &left_out);
  report.cut.at_interfaces = {};
  if (last && !hybrid) lattice = {};
  std::int64_t far_cells = report.cut.far_cells;
  if (how.left_out != kOutside) {
    const auto materials = mesh.blocks[0].materials.begin();
    far_cells -= std::count(materials, materials + far_cells, how.left_out);
    stage.reset();
    if (hybrid) {  // whole cells may need the points
      stage.emplace(execution, "drop background");
      drop_cells(mesh, how.left_out, execution);
    } else {
      drop_material(mesh, how.left_out, execution);
    }
  }

  stage.emplace(execution, "improve");
  ImproveOptions improvement;
  improvement.quality = how.options.quality;
  improvement.anchors = report.repair.anchors;
  if (how.cubic && improvement.quality <= kFarQuality) improvement.first_cell = far_cells;
  improvement.keep_numbers = hybrid;
  if (how.coarse) improvement.longest_pulled = kLeftToFit * std::ranges::min(field.spacing());
  report.improve = improve(mesh, field, how.image.size(), improvement, execution);

  if (how.coarse) {
    stage.emplace(execution, "fit");
    borders = find_borders(mesh, execution);
    report.fit = fit_interfaces(mesh, field, how.image.size(),
                                {how.options.quality, how.left_out, report.repair.anchors, &*borders}, execution);
  }

  if (hybrid) {
    stage.emplace(execution, "whole cells");
    borders.reset();  // other cells have other facets
    WholeCellOptions whole;
    whole.quality = std::max(how.options.quality, report.quality_floor);
    keep_whole(mesh, lattice, whole, execution);
    if (last) lattice = {};
    drop_unused_points(mesh, execution);
  }
  return mesh;
}

}  // namespace

template <int Dim>
Mesh<Dim> mesh_with_guarantee(const LabelImage<Dim>& given, const GreyInput<Dim>* grey, const MeshOptions& options,
                              GuaranteeReport& report, std::optional<Borders>& borders, Execution& execution) {
  if (options.closed_border && grey)
    throw Error(ErrorKind::usage, "--border: cannot be closed with a grey image; pad the image or choose flat");
  std::optional<LabelImage<Dim>> larger;
  if (options.closed_border) larger = padded(given, options.background);
  const LabelImage<Dim>& image = larger ? *larger : given;
  const MaterialId background = material_of(image.labels, options.background);
  const bool drop =
      background != kOutside && (!options.keep_background || material_of(given.labels, options.background) == kOutside);

  std::optional<Execution::Stage> stage;
  stage.emplace(execution, "tree");
  SizingRule rule = complete_sizes(image, options, execution);
  if (larger && !rule.voxel_size.empty()) rule.voxel_size = padded_sizes(rule.voxel_size, given.extent, image.extent);
  const double smallest = smallest_size(rule, rule.min_size);
  if (rule.max_size == 0) rule.max_size = kDefaultCoarsening * rule.min_size;
  const SizedLattice<Dim> sized = choose_cubic_lattice(image, smallest, std::max(smallest, rule.max_size));
  report.quality_floor = quality_floor(sized.lattice, options.quality_floor, execution);
  Spacetree<Dim> tree =
      build_spacetree<Dim>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1, execution);

  stage.reset();  // the field times itself
  const FieldKind kind = field_kind(options, grey, FieldKind::dgf);
  if (options.preserve_volume && (kind == FieldKind::grey || kind == FieldKind::solid_angle))
    throw Error(ErrorKind::usage, "--preserve-volume: is not for the fields grey and solid-angle; leave it out");
  Field<Dim> field = make_field(image, grey, kind, options, execution);

  stage.emplace(execution, "lattice");
  SimplexLattice<Dim> lattice = tessellate_body_centred(std::move(tree), execution);

  const Shaping<Dim> how{image, options, drop ? background : kOutside,
                         is_coarse(rule, *std::ranges::min_element(image.frame.spacing)),
                         stretch(sized.lattice) <= kMostStretch};
  stage.reset();
  Mesh<Dim> mesh = shape_mesh(how, lattice, !options.preserve_volume, field, report, borders, execution);
  if (options.preserve_volume) {
    VolumeKeeper<Dim> keeper(image, drop ? background : kOutside);
    while (keeper.look(mesh, report.volume, execution)) {
      field = make_field(image, grey, kind, options, execution, keeper.scale());
      mesh = shape_mesh(how, lattice, false, field, report, borders, execution);
    }
    if (report.volume.labels_off > 0)
      execution.warn("--preserve-volume: " + std::to_string(report.volume.labels_off) + " of " +
                     std::to_string(report.volume.labels) +
                     " labels of 1,000 voxels or more are off by more than 0.5 %; choose a smaller --min-size");
  }
  if (larger) restore_place(mesh, *larger, given);
  return mesh;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                          \
  template Mesh<DIM> mesh_with_guarantee(const LabelImage<DIM>&, const GreyInput<DIM>*, const MeshOptions&, \
                                         GuaranteeReport&, std::optional<Borders>&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
