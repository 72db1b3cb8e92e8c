/// \file
/// Which voxels a cell of the lattice overlaps, along one axis and in whole numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace treemarch {

/// One axis of a lattice of `cells` cells that fills an image of `voxels` voxels.
struct AxisCover {
  AxisCover(std::int32_t voxel_count, std::int32_t cell_count) : voxels(voxel_count), cells(cell_count) {
    const std::int64_t common = std::gcd(voxels, cells);
    cell_side = voxels / common;
    voxel_side = cells / common;
  }

  std::int64_t voxels, cells;
  std::int64_t cell_side, voxel_side;  ///< lengths in a common unit, as short as they can be

  /// The first and the last voxel that the cells [begin, end) overlap.
  [[nodiscard]] std::int32_t first_voxel(std::int64_t begin) const {
    return static_cast<std::int32_t>(begin * cell_side / voxel_side);
  }
  [[nodiscard]] std::int32_t last_voxel(std::int64_t end) const {
    return static_cast<std::int32_t>((end * cell_side - 1) / voxel_side);
  }
  /// Length that the cells [begin, end) share with a voxel, in the common unit.
  [[nodiscard]] std::int64_t overlap(std::int64_t begin, std::int64_t end, std::int64_t voxel) const {
    return std::min(end * cell_side, (voxel + 1) * voxel_side) - std::max(begin * cell_side, voxel * voxel_side);
  }
};

}  // namespace treemarch
