#include <algorithm>

#include "treemarch/core/parallel.h"
#include "treemarch/field/field.h"
#include "treemarch/march/cut.h"
#include "treemarch/march/quality_floor.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/prepare.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/default_sizes.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

constexpr double kQualityFloor = 18;

/// The sizes of the options, completed by the defaults.
template <int Dim>
SizingRule sizing_rule(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution) {
  const SizingRule& given = options.sizes;
  SizingRule rule = given;
  if (given.min_size == 0) {
    const SizingRule defaults = default_sizes(image, given.max_size, execution);
    rule.min_size = defaults.min_size;
    rule.material_interface_size = defaults.material_interface_size;
  }
  if (given.max_size == 0) rule.max_size = kDefaultCoarsening * rule.min_size;
  return rule;
}

double smallest_size(const SizingRule& rule) {
  double smallest = rule.min_size;
  for (const double s : rule.material_size)
    if (s > 0) smallest = std::min(smallest, s);
  for (const double s : rule.material_interface_size)
    if (s > 0) smallest = std::min(smallest, s);
  for (const auto& i : rule.interface_size) smallest = std::min(smallest, i.size);
  return smallest;
}

/// Leaves that lie deep inside a material that will not be written.
template <int Dim>
std::vector<std::uint8_t> leaves_inside(const Spacetree<Dim>& tree, const Field<Dim>& field, MaterialId material,
                                        Execution& execution) {
  std::vector<std::uint8_t> inside(tree.leaves.size(), 0);
  parallel_for(execution, static_cast<std::int64_t>(inside.size()), 2048, [&](std::int64_t i) {
    const Leaf<Dim>& leaf = tree.leaves[i];
    Vec<Dim> low{}, high{};
    for (int d = 0; d < Dim; ++d) {
      const double margin = tree.lattice.unit[d];
      low[d] = leaf.corner[d] * tree.lattice.unit[d] - margin;
      high[d] = (leaf.corner[d] + tree.extent_of(leaf)[d]) * tree.lattice.unit[d] + margin;
    }
    inside[i] = field.uniform_label(low, high) == material;
  });
  return inside;
}

}  // namespace

template <int Dim>
Mesh<Dim> mesh_with_guarantee(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution) {
  const auto stage = [&](const char* name) { return Execution::Stage(execution, name); };
  const SizingRule rule = sizing_rule(image, options, execution);
  const SizedLattice<Dim> sized = choose_cubic_lattice(image, smallest_size(rule), rule.max_size);
  CutOptions cut;
  cut.quality_floor = stretch(sized.lattice) <= kMostStretch
                          ? kQualityFloor
                          : std::min(kQualityFloor, guaranteed_quality(sized.lattice.unit) - 1e-6);
  if (cut.quality_floor < kQualityFloor)
    execution.warn("--min-size: cells of this size fill the box only when stretched; dihedral angles are at least " +
                   std::to_string(cut.quality_floor) + " degrees after the cut; choose smaller cells for 18");

  Spacetree<Dim> tree;
  {
    const auto timed = stage("tree");
    tree = build_spacetree<Dim>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1,
                                execution);
  }
  Field<Dim> field;
  {
    const auto timed = stage("field");
    FieldOptions how;
    if (options.field) how.kind = *options.field;
    how.background = options.background;
    field = build_field(image, how, execution);
  }
  SimplexLattice<Dim> lattice;
  {
    const auto timed = stage("lattice");
    std::vector<std::uint8_t> skip;
    const MaterialId background = material_of(image.labels, options.background);
    if (!options.keep_background && background != kOutside) skip = leaves_inside(tree, field, background, execution);
    lattice = tessellate_body_centred(tree, skip, execution);
  }
  tree = {};
  const auto timed = stage("cut");
  CutReport report;
  return cut_lattice(lattice, field, image.labels, cut, report, execution);
}

template Mesh<2> mesh_with_guarantee(const LabelImage<2>&, const MeshOptions&, Execution&);
template Mesh<3> mesh_with_guarantee(const LabelImage<3>&, const MeshOptions&, Execution&);

}  // namespace treemarch
