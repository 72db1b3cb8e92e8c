/// \file
/// Sparse storage of label weights at the voxel centres of an image, for fast interpolation.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/field/voxel_lists.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Label weights in bricks of 4x4x4 (3D) or 8x8 (2D) voxels. Each brick also holds the first layer of voxels of its
/// upper neighbours (beyond the image: the last voxels again), so that all voxels around a point are found in one
/// brick. A brick far from every interface is one word; one with up to 8 labels is a dense table, any other a list a
/// voxel. Weights are fixed point, so that sums at lattice points are exact and do not depend on the order of
/// summation.
template <int Dim>
struct Bricks {
  static constexpr int kShift = VoxelLists<Dim>::kShift;
  static constexpr int kSide = 1 << kShift;
  static constexpr int kReach = kSide + 1;
  static constexpr int kVoxels = Dim == 3 ? kReach * kReach * kReach : kReach * kReach;
  /// Weight of a voxel that is wholly of one label.
  static constexpr std::uint32_t kOne = VoxelLists<Dim>::kOne;

  /// A reference with this bit set holds the material of a uniform brick in its low 32 bits. Any other is
  /// (form << 60) | (chunk << 32) | (word in that chunk).
  static constexpr std::uint64_t kUniform = std::uint64_t{1} << 63;
  enum Form : unsigned {
    /// kVoxels + 1 words: offsets to the entries; then two words an entry: material, weight; a voxel's own label first.
    kLists,
    /// 2 words: materials, kOutside where there are fewer; 8 words: which of them is the voxel's own, 4 bits for each
    /// of
    /// the brick's 64 voxels without the upper layer; one word a voxel: weights, the first in the lower half.
    kTable2,
    kTable4,  ///< the same with 4 words of materials and two words a voxel
    kTable8   ///< the same with 8 words of materials and four words a voxel
  };

  static constexpr int kOwnWords = 8;

  Coord<Dim> extent{};              ///< voxels per axis
  Coord<Dim> brick_extent{};        ///< bricks per axis
  std::vector<std::uint64_t> refs;  ///< one a brick, first axis fastest
  std::vector<std::vector<std::uint32_t>> chunks;

  static constexpr Form form_of(std::uint64_t ref) { return static_cast<Form>(ref >> 60 & 7U); }
  /// Place of a voxel in the brick that it belongs to.
  static constexpr int place_in_brick(const Coord<Dim>& voxel) {
    int place = 0;
    for (int d = Dim; d-- > 0;) place = place * kReach + (voxel[d] & (kSide - 1));
    return place;
  }
  [[nodiscard]] std::int64_t brick_of(const Coord<Dim>& voxel) const {
    std::int64_t b = 0;
    for (int d = Dim; d-- > 0;) b = b * brick_extent[d] + (voxel[d] >> kShift);
    return b;
  }
  /// First word of a brick. \pre `ref` is not uniform.
  [[nodiscard]] const std::uint32_t* data(std::uint64_t ref) const {
    return chunks[ref >> 32 & 0x0fffffffU].data() + static_cast<std::uint32_t>(ref);
  }
  /// The image's material of a voxel.
  [[nodiscard]] MaterialId own(const Coord<Dim>& voxel) const {
    const std::uint64_t ref = refs[brick_of(voxel)];
    if (ref & kUniform) return static_cast<MaterialId>(ref);
    const std::uint32_t* brick = data(ref);
    const Form form = form_of(ref);
    if (form == kLists) return brick[brick[place_in_brick(voxel)]];
    const int place = VoxelLists<Dim>::place_in_brick(voxel);
    return brick[brick[(1 << form) + place / 8] >> (4 * (place % 8)) & 0xfU];
  }
};

/// Lays out the weights for interpolation.
template <int Dim>
Bricks<Dim> make_bricks(const VoxelLists<Dim>& lists, const Execution& execution);

}  // namespace treemarch
