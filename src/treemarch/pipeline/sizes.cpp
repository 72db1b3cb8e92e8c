#include "treemarch/pipeline/sizes.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/pipeline/prepare.h"
#include "treemarch/sizing/component_sizing.h"
#include "treemarch/sizing/default_sizes.h"

namespace treemarch {

template <int Dim>
void check_sizes(const LabelImage<Dim>& image, const SizingRule& sizes) {
  const auto refuse = [](const std::string& what) { throw Error(ErrorKind::usage, what); };
  const auto check = [&](double size, const char* option) {
    if (!(size >= 0) || !std::isfinite(size)) refuse(std::string(option) + ": must be finite and not negative");
  };
  check(sizes.min_size, "--min-size");
  check(sizes.max_size, "--max-size");
  check(sizes.tolerance, "--tolerance");
  check(sizes.floor_size, "floor_size");
  for (const double s : sizes.material_size) check(s, "--size");
  for (const auto& i : sizes.interface_size) check(i.size, "--interface");
  if (sizes.max_size > 0 && sizes.min_size > sizes.max_size)
    refuse("--min-size: is above --max-size; give a smaller one");
  if (!(sizes.grading > 0 && sizes.grading <= 1)) refuse("--grading: must be above 0, and 1 at most");
  constexpr int kMostLayers = 100;
  if (sizes.layers < 0 || sizes.layers > kMostLayers) refuse("--layers: must be from 0 to 100");
  if (!sizes.voxel_size.empty() && static_cast<std::int64_t>(sizes.voxel_size.size()) != image.voxels.size())
    refuse("voxel_size: has " + std::to_string(sizes.voxel_size.size()) + " entries; give one for each voxel");
}

template <int Dim>
SizingRule complete_sizes(const LabelImage<Dim>& image, const MeshOptions& options, const Execution& execution) {
  SizingRule rule = options.sizes;
  const auto take = [&](SizingRule found) {
    rule.min_size = found.min_size;
    rule.max_size = found.max_size;
    rule.tolerance = found.tolerance;
    rule.floor_size = found.floor_size;
    rule.material_interface_size = std::move(found.material_interface_size);
  };
  // Two cells with sides of a voxel have no room in a few places of a layer of two voxels (docs/stages/sizing.md).
  constexpr double kForLayers = 0.9;
  const bool fine_layers = rule.layers > 0 && options.method == Method::guaranteed;
  const double least = *std::ranges::min_element(image.frame.spacing) * (fine_layers ? kForLayers : 1);
  rule.layer_floor = rule.min_size > 0 ? rule.min_size : least;
  if (rule.tolerance > 0) {
    double floor = rule.min_size > 0 ? rule.min_size : least;
    if (rule.max_size > 0) floor = std::min(floor, rule.max_size);
    take(driven_sizes(image, rule.tolerance, floor, rule.max_size, execution));
  } else if (rule.min_size == 0 && options.method == Method::guaranteed) {
    if constexpr (Dim < 4) {
      take(default_sizes(image, options.detail, {.least = fine_layers ? least : 0, .largest = rule.max_size},
                         execution));
      const MaterialId background = options.keep_background ? kOutside : material_of(image.labels, options.background);
      rule.few_voxels =
          component_sizes<Dim>(image, {options.min_component, background, rule.floor_size, least}, execution);
    }
  }
  return rule;
}

template void check_sizes(const LabelImage<2>&, const SizingRule&);
template void check_sizes(const LabelImage<3>&, const SizingRule&);
template void check_sizes(const LabelImage<4>&, const SizingRule&);
template SizingRule complete_sizes(const LabelImage<2>&, const MeshOptions&, const Execution&);
template SizingRule complete_sizes(const LabelImage<3>&, const MeshOptions&, const Execution&);
template SizingRule complete_sizes(const LabelImage<4>&, const MeshOptions&, const Execution&);

}  // namespace treemarch
