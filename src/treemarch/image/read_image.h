/// \file
/// Image files in: picks the format by content, then by extension.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

struct ReadOptions {
  /// Label 1 where the value is at least this, else 0.
  std::optional<double> threshold;
  /// Which image of a file that holds several (4D), from 0.
  std::optional<int> volume;
  /// Sides of a voxel, one an axis or one for all, for formats that carry none (TIFF, PNG).
  std::vector<double> spacing;
  /// Keep all volumes of a file as a further axis: LabelImage<4>, or <3> of a flat image. There must be several.
  bool space_time = false;
  /// Take integral values as labels even where they look like those of a grey image.
  bool any_labels = false;
};

using AnyImage = std::variant<LabelImage<2>, LabelImage<3>, LabelImage<4>>;
using AnyGreyImage = std::variant<GreyImage<2>, GreyImage<3>>;

/// Reads a label image: NIfTI-1/-2, NRRD, MetaImage, TIFF, PNG, a DICOM file; or a folder: a DICOM series, or a stack
/// of TIFF or PNG slices in the natural order of their names. Labels are the file's own values; the frame is the file's
/// own world (see Frame), in mm. \throw Error(input) for all that is wrong with the file, Error(usage) for options that
/// do not fit it,
///        Error(limits) when it does not fit the memory
AnyImage read_label_image(const std::string& path, const ReadOptions& options, const Execution& execution);

/// Reads the same files as grey values; `threshold`, `space_time` and `any_labels` do not apply.
AnyGreyImage read_grey_image(const std::string& path, const ReadOptions& options, const Execution& execution);

}  // namespace treemarch
