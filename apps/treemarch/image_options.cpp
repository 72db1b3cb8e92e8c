#include "image_options.h"

#include "treemarch/pipeline/label_table.h"
#include "treemarch/pipeline/length.h"

namespace treemarch::app {
namespace {

ReadOptions read_options(const ImageOptions& options) {
  ReadOptions read;
  read.threshold = options.threshold;
  read.volume = options.volume;
  read.any_labels = options.any_labels;
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

AnyImage load_image(const std::string& path, const ImageOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "read image");
  return read_label_image(path, read_options(options), execution);
}

AnyGreyImage load_grey_image(const std::string& path, const ImageOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "read image");
  return read_grey_image(path, read_options(options), execution);
}

}  // namespace treemarch::app
