/// \file
/// Where an image is all of one material, so that a pass over its voxels can skip most of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// An image in blocks of kSide voxels along each axis; the last ones of an axis may be smaller.
template <int Dim>
class UniformBlocks {
 public:
  static constexpr int kShift = Dim == 1 ? 6 : Dim == 2 ? 4 : Dim == 3 ? 3 : 2;
  static constexpr std::int32_t kSide = 1 << kShift;
  static constexpr std::int64_t kVoxels = std::int64_t{1} << (Dim * kShift);
  static constexpr MaterialId kMixed = kOutside;

  /// Reads the image once, whole rows at a time.
  UniformBlocks(const LabelImage<Dim>& image, const Execution& execution);

  /// Blocks along each axis.
  [[nodiscard]] const Coord<Dim>& extent() const { return extent_; }
  [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(material_.size()); }
  /// Its material, or kMixed. Blocks are numbered with the first axis fastest.
  [[nodiscard]] MaterialId operator[](std::int64_t block) const { return material_[static_cast<std::size_t>(block)]; }
  /// The material of all blocks that the voxels from `first` to `last` lie in, or kMixed. \pre first <= last; what lies
  /// beyond the image is ignored, but some voxel lies in it.
  [[nodiscard]] MaterialId within(Coord<Dim> first, Coord<Dim> last) const;

  static Coord<Dim> block_of(Coord<Dim> voxel) {
    for (auto& v : voxel) v >>= kShift;
    return voxel;
  }

 private:
  template <class T>
  void find(const LabelImage<Dim>& image, const T* voxels, const Execution& execution);

  Coord<Dim> voxels_{}, extent_{};
  std::vector<MaterialId> material_;
};

/// Part of an image: the voxels from `begin` up to but without `end`.
template <int Dim>
struct VoxelBox {
  Coord<Dim> begin{}, end{};

  [[nodiscard]] bool is_empty() const {
    for (int d = 0; d < Dim; ++d)
      if (begin[d] >= end[d]) return true;
    return false;
  }
  [[nodiscard]] std::int64_t size() const {
    std::int64_t n = 1;
    for (int d = 0; d < Dim; ++d) n *= end[d] - begin[d];
    return n;
  }
};

/// The whole numbers from `low` to `high`, both included, that are not negative and below `limit`: the first one and
/// one past the last. Without calls for rounding, as it is used for every cell.
inline std::pair<std::int32_t, std::int32_t> whole_between(double low, double high, std::int32_t limit) {
  const double from = std::clamp(low, 0.0, static_cast<double>(limit));
  const auto begin = static_cast<std::int32_t>(from);
  const std::int32_t end = high < 0 ? 0 : static_cast<std::int32_t>(std::min(high, limit - 1.0)) + 1;
  return {begin + (begin < from ? 1 : 0), end};
}

/// The voxels whose centres lie between two corners of the inner frame or up to `slack` voxels beyond, in an image of
/// so many voxels.
template <int Dim>
VoxelBox<Dim> centres_between(const Vec<Dim>& low, const Vec<Dim>& high, const Vec<Dim>& voxels_per_length,
                              const Coord<Dim>& voxels, double slack) {
  VoxelBox<Dim> box;
  for (int d = 0; d < Dim; ++d)
    std::tie(box.begin[d], box.end[d]) = whole_between(low[d] * voxels_per_length[d] - 0.5 - slack,
                                                       high[d] * voxels_per_length[d] - 0.5 + slack, voxels[d]);
  return box;
}

/// The blocks that a box of voxels, which is not empty, overlaps.
template <int Dim>
VoxelBox<Dim> blocks_around(const VoxelBox<Dim>& box) {
  VoxelBox<Dim> blocks{UniformBlocks<Dim>::block_of(box.begin), {}};
  for (int d = 0; d < Dim; ++d) blocks.end[d] = ((box.end[d] - 1) >> UniformBlocks<Dim>::kShift) + 1;
  return blocks;
}

/// The voxels of a block, in an image of so many voxels.
template <int Dim>
VoxelBox<Dim> voxels_of_block(const Coord<Dim>& block, const Coord<Dim>& voxels) {
  VoxelBox<Dim> box;
  for (int d = 0; d < Dim; ++d) {
    box.begin[d] = block[d] << UniformBlocks<Dim>::kShift;
    box.end[d] = std::min(voxels[d], box.begin[d] + UniformBlocks<Dim>::kSide);
  }
  return box;
}

/// Calls f(first voxel, its linear index) for every row of a box of voxels along the first axis, in scan order.
template <int Dim, class F>
void for_each_row(const VoxelBox<Dim>& box, const Coord<Dim>& voxels, F&& f) {
  Coord<Dim> c = box.begin;
  while (true) {
    f(c, linear_index(c, voxels));
    int d = 1;
    while (d < Dim && ++c[d] == box.end[d]) {
      c[d] = box.begin[d];
      ++d;
    }
    if (d >= Dim) return;
  }
}

}  // namespace treemarch
