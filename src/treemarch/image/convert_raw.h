/// \file
/// From what a file holds to images that stages take.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_encoder.h"
#include "treemarch/image/label_image.h"
#include "treemarch/image/raw_image.h"

namespace treemarch {

/// The geometry of a file as a frame. For Dim = dim + 1 the last axis is that of the volumes (letter "T").
/// \pre Dim is raw.dim or raw.dim + 1
/// \throw Error(input) where a spacing is zero or not finite, or the affine is singular
template <int Dim>
Frame<Dim> make_frame(const std::string& path, const RawImage& raw);

/// Replaces the spacing of an image of which the file carries none. \param spacing one number an axis, or one for all
/// \throw Error(usage)
void override_spacing(const std::string& path, std::span<const double> spacing, RawImage& raw);

struct LabelRules {
  std::optional<double> threshold;  ///< label 1 where the value is at least this, else 0
  bool any_labels = false;          ///< do not refuse what looks like a grey image
};

/// The labels of consecutive volumes. Reads the samples of the image to their end, a slab of bounded size at a time, so
/// that what is held beside it is the result alone.
/// \throw Error(input) for values that are not integral, not finite or beyond 32 bits, a grey image without a
/// threshold, or a threshold that no voxel reaches
EncodedLabels convert_labels(const std::string& path, RawImage& raw, std::int64_t first_volume, std::int64_t volumes,
                             const LabelRules& rules, const Execution& execution);

/// The grey values of one volume, read in the same way. \throw Error(input) for values that are not finite
std::vector<float> convert_grey(const std::string& path, RawImage& raw, std::int64_t volume,
                                const Execution& execution);

}  // namespace treemarch
