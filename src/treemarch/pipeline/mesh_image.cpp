#include "treemarch/pipeline/mesh_image.h"

#include <chrono>
#include <cmath>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/free_memory.h"
#include "treemarch/pipeline/drop_material.h"
#include "treemarch/pipeline/methods.h"
#include "treemarch/pipeline/prepare.h"
#include "treemarch/pipeline/sizes.h"
#include "treemarch/sizing/lattice.h"

namespace treemarch {

namespace {

constexpr double kMostQualityFloor = 18.4, kMostQuality = 40;
constexpr std::int64_t kLargeImage = 50'000'000;  // voxels

/// The bound on the angles holds for one kind of tree only.
void check_guaranteed(const MeshOptions& options) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorKind::usage, what + " with --method guaranteed; leave it out or choose --method paper");
  };
  if (options.pattern != "auto" && options.pattern != "2") refuse("--pattern: must be 2");
  if (options.balance != 1) refuse("--balance: must be 1");
  if (options.snap) refuse("--snap: cannot be chosen");
  if (options.smooth) refuse("--smooth: is not done");
  if (!options.weights.empty()) refuse("--weight: has no meaning");
  if (options.order != MaterialOrder::largest || !options.first.empty()) refuse("--order: has no meaning");
  if (!(options.quality_floor >= 0 && options.quality_floor <= kMostQualityFloor))
    throw Error(ErrorKind::usage, "--quality-floor: must be from 0 to 18.4, the bound that is proved");
  if (!(options.quality >= 0 && options.quality <= kMostQuality))
    throw Error(ErrorKind::usage, "--quality: must be from 0 to 40 degrees; 20 to 25 can be reached");
}

/// What only the default method does.
void check_others(const MeshOptions& options) {
  if (options.closed_border)
    throw Error(ErrorKind::usage, "--border: can be closed with --method guaranteed alone; choose that");
  if (options.preserve_volume)
    throw Error(ErrorKind::usage, "--preserve-volume: is done with --method guaranteed alone; choose that");
}

/// Boxes are neither cut nor improved.
void check_boxes(const MeshOptions& options) {
  const auto refuse = [](const std::string& option) {
    throw Error(ErrorKind::usage, option + ": is not used by --elements hex; leave it out");
  };
  const MeshOptions usual;
  if (options.method != Method::guaranteed && options.method != Method::paper) refuse("--method for a reference");
  if (options.snap) refuse("--snap");
  if (options.smooth) refuse("--smooth");
  if (options.order != usual.order || !options.first.empty()) refuse("--order");
  if (options.quality != usual.quality) refuse("--quality");
  if (options.quality_floor != usual.quality_floor) refuse("--quality-floor");
  if (options.min_component != usual.min_component) refuse("--min-component");
  if (options.closed_border) refuse("--border");
  if (options.field && options.shift == 0) refuse("--field without --shift");
  if (options.field == FieldKind::solid_angle)
    throw Error(ErrorKind::usage, "--field: solid-angle gives no surface to shift to; choose another");
}

void check_shift(const MeshOptions& options) {
  if (!(options.shift >= 0 && options.shift < 0.5))
    throw Error(ErrorKind::usage, "--shift: must be at least 0 and below 0.5");
  if (options.shift > 0 && options.elements != Elements::boxes)
    throw Error(ErrorKind::usage, "--shift: is for --elements hex; leave it out");
}

}  // namespace

template <int Dim>
MeshResult<Dim> mesh_image(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution,
                           const GreyInput<Dim>* grey) {
  const auto start = std::chrono::steady_clock::now();
  check_sizes(image, options.sizes);
  (void)parse_pattern<Dim>(options.pattern);
  if (Dim == 4 && options.method != Method::paper)
    throw Error(ErrorKind::usage, "--space-time: four dimensions need --method paper");
  if (options.facets != FacetRule::midpoint && options.method != Method::paper)
    throw Error(ErrorKind::usage, "--facets: is of --method paper; leave it out or choose that method");
  check_shift(options);
  const bool boxes = Dim < 4 && options.elements == Elements::boxes;
  const bool guaranteed = !boxes && options.method == Method::guaranteed;
  if (boxes)
    check_boxes(options);
  else if (guaranteed)
    check_guaranteed(options);
  else
    check_others(options);

  MeshResult<Dim> result;
  if constexpr (Dim == 4)
    result.mesh = mesh_space_time(image, options, execution);
  else if (boxes)
    result.mesh = mesh_by_boxes(image, grey, options, result.shift.emplace(), execution);
  else if (guaranteed)
    result.mesh = mesh_with_guarantee(image, grey, options, result.guarantee.emplace(), result.borders, execution);
  else
    result.mesh = options.method == Method::paper ? mesh_by_paper(image, grey, options, execution)
                                                  : mesh_by_reference(image, grey, options, execution);
  // The field of a large image takes as much memory as the image.
  if (product(image.extent) >= kLargeImage) give_back_free_memory();
  const MaterialId background = material_of(image.labels, options.background);
  if (!guaranteed && !options.keep_background && background != kOutside)
    drop_material(result.mesh, background, execution);
  result.mesh.labels = image.labels;
  result.mesh.names = image.names;
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

template MeshResult<2> mesh_image(const LabelImage<2>&, const MeshOptions&, Execution&, const GreyInput<2>*);
template MeshResult<3> mesh_image(const LabelImage<3>&, const MeshOptions&, Execution&, const GreyInput<3>*);
template MeshResult<4> mesh_image(const LabelImage<4>&, const MeshOptions&, Execution&, const GreyInput<4>*);

}  // namespace treemarch
