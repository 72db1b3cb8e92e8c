/// \file
/// How large cells shall be, and where.
#pragma once

#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// Sizes are lengths of the longest side of a cell, in the image's physical unit. Further rules (places, a size image,
/// error and thickness) become further members; the finest demand on a cell wins.
struct SizingRule {
  double min_size = 0;                ///< at interfaces, unless stated otherwise; 0: the smallest spacing of the image
  double max_size = 0;                ///< everywhere else; 0: kDefaultCoarsening times the smallest cell
  std::vector<double> material_size;  ///< for all cells of a material; 0 or no entry: max_size
  /// At all interfaces of a material; 0 or no entry: min_size. Where two materials meet, the smaller one counts.
  std::vector<double> material_interface_size;

  struct Interface {
    MaterialId first = 0, second = 0;  ///< in either order
    double size = 0;
  };
  std::vector<Interface> interface_size;  ///< overrides both materials' sizes at their interface
};

/// A side up to this factor above a size counts as that size: affines are often stored in single precision, which makes
/// voxels that are meant to be cubes differ in the seventh digit.
inline constexpr double kSizeTolerance = 1 + 1e-5;

/// The largest cell in units of the smallest, where no largest size is given.
inline constexpr int kDefaultCoarsening = 8;

}  // namespace treemarch
