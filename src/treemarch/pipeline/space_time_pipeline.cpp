#include "treemarch/core/error.h"
#include "treemarch/march/paper_march.h"
#include "treemarch/march/sharp_shares.h"
#include "treemarch/pipeline/between_moments.h"
#include "treemarch/pipeline/material_order.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/sizes.h"
#include "treemarch/sizing/assign_materials.h"
#include "treemarch/sizing/lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

void check(const MeshOptions& options) {
  const auto refuse = [](const char* what) {
    throw Error(ErrorKind::usage, std::string(what) + " in four dimensions; leave it out");
  };
  if (options.smooth) refuse("--smooth: is not done");
  if (options.field) refuse("--field: cannot be chosen");
  if (options.elements != Elements::simplices) refuse("--elements: must be tet (pentatopes)");
}

}  // namespace

Mesh<4> mesh_space_time(const LabelImage<4>& image, const MeshOptions& options, Execution& execution) {
  check(options);
  // Vertices are at the moments themselves: half-way between them what moves would be neither here nor there.
  LabelImage<4> between = between_moments(image, execution);
  const SizingRule sizes = sizes_between_moments(image, complete_sizes(image, options, execution), execution);
  const SizedLattice<4> sized = choose_lattice(between, parse_pattern<4>(options.pattern), sizes, execution);
  Spacetree<4> tree = build_spacetree<4>(sized.lattice, sized.pattern,
                                         required_levels(between, sized, sizes, execution), options.balance, execution);
  assign_materials(tree, between, options.weights, execution);
  between = {};
  MidpointOptions tessellation;
  tessellation.facets = options.facets;
  Mesh<4> mesh = tessellate_midpoint(tree, tessellation, execution);
  tree = {};
  move_to_moments(mesh, image, execution);
  mesh.labels = image.labels;
  mesh.names = image.names;
  PaperMarchOptions<4> march;
  march.order = material_order(image, options.order, options.first);
  march.field = sharp_shares(image);
  if (options.snap) march.snap = *options.snap;
  march_materials(mesh, march, execution);
  return mesh;
}

}  // namespace treemarch
