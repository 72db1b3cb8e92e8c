#include "image_options.h"

#include <cmath>

#include "treemarch/image/time_axis.h"
#include "treemarch/pipeline/label_table.h"
#include "treemarch/pipeline/length.h"

namespace treemarch::app {
namespace {

ReadOptions read_options(const ImageOptions& options) {
  ReadOptions read;
  read.threshold = options.threshold;
  read.volume = options.volume;
  read.any_labels = options.any_labels;
  read.space_time = options.space_time;
  if (options.spacing) {
    for (const std::string_view side : split(*options.spacing, ','))
      read.spacing.push_back(parse_length(side, 1, "--spacing"));
  }
  return read;
}

}  // namespace

void add_image_options(CLI::App& command, ImageOptions& options) {
  command.add_option(
      "--spacing", options.spacing,
      "Sides of a voxel where the format carries none: one for all axes or one each, 0.5 or 0.5,0.5,3mm");
  command.add_option("--threshold", options.threshold, "Grey image: label 1 where the value is at least this, else 0");
  command.add_option("--volume", options.volume, "Which volume of a 4D file, from 0");
  command.add_flag("--any-labels", options.any_labels, "Take integral values as labels even where they look grey");
}

void add_space_time_options(CLI::App& command, ImageOptions& options) {
  command.add_flag("--space-time", options.space_time,
                   "Take the volumes of the file as moments: one mesh of space and time (pentatopes, .xdmf)");
  command.add_option("--time-step", options.time_step,
                     "How long a step of time counts beside space; default: the smallest side of a voxel");
}

template <int Dim>
void scale_time(const std::string& path, const ImageOptions& options, Frame<Dim>& frame) {
  if (!options.space_time) {
    if (options.time_step) throw Error(ErrorKind::usage, "--time-step: needs --space-time; leave it out");
    return;
  }
  const double voxel = *std::min_element(frame.spacing.begin(), frame.spacing.end() - 1);
  if (!(frame.spacing[Dim - 1] > 0) || !std::isfinite(frame.spacing[Dim - 1]))
    throw Error(ErrorKind::input, path + ": its step of time is not above 0; repair the header");
  const double step = options.time_step ? parse_length(*options.time_step, voxel, "--time-step") : voxel;
  if (step <= 0) throw Error(ErrorKind::usage, "--time-step: must be above 0");
  set_time_step(frame, step);
}

template void scale_time(const std::string&, const ImageOptions&, Frame<2>&);
template void scale_time(const std::string&, const ImageOptions&, Frame<3>&);
template void scale_time(const std::string&, const ImageOptions&, Frame<4>&);

AnyImage load_image(const std::string& path, const ImageOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "read image");
  return read_label_image(path, read_options(options), execution);
}

AnyGreyImage load_grey_image(const std::string& path, const ImageOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "read image");
  return read_grey_image(path, read_options(options), execution);
}

}  // namespace treemarch::app
