/// \file
/// How large cells shall be, and where.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// Sizes are lengths of the longest side of a cell, in the image's physical unit. The finest demand on a cell wins.
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

  std::vector<float> voxel_size;  ///< one a voxel of the image, or empty: sizes by place; 0: none asked for
  struct Voxel {
    std::int64_t index = 0;  ///< in the image
    float size = 0;          ///< > 0
  };
  std::vector<Voxel> few_voxels;  ///< the same where few voxels ask for a size

  double tolerance = 0;   ///< cells are split while they misplace interfaces by more (error_sizing.h); 0: not looked at
  int layers = 0;         ///< cells across every layer of a material, at least (layer_sizing.h); 0: not looked at
  double floor_size = 0;  ///< no cell is smaller for the tolerance alone; 0: the smallest of the other sizes
  double layer_floor = 0;  ///< no cell is smaller for layers alone; 0: the smallest of the other sizes
  double grading = 1;      ///< sizes grow by at most this much a unit of length, above 0 to 1; 1: as the balance allows
};

/// A side up to this factor above a size counts as that size: affines are often stored in single precision, which makes
/// voxels that are meant to be cubes differ in the seventh digit.
inline constexpr double kSizeTolerance = 1 + 1e-5;

/// The largest cell in units of the smallest, where no largest size is given.
inline constexpr int kDefaultCoarsening = 8;

/// The smallest size that a rule asks for anywhere. \param otherwise counts where min_size is not given.
[[nodiscard]] inline double smallest_size(const SizingRule& rule, double otherwise) {
  double smallest = rule.min_size > 0 ? rule.min_size : otherwise;
  const auto lower = [&](double size) {
    if (size > 0) smallest = std::min(smallest, size);
  };
  std::ranges::for_each(rule.material_size, lower);
  std::ranges::for_each(rule.material_interface_size, lower);
  for (const auto& i : rule.interface_size) lower(i.size);
  std::ranges::for_each(rule.voxel_size, lower);
  for (const auto& v : rule.few_voxels) lower(v.size);
  if (rule.tolerance > 0) lower(rule.floor_size);
  if (rule.layers > 0) lower(rule.layer_floor);
  return smallest;
}

}  // namespace treemarch
