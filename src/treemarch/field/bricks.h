/// \file
/// Sparse storage of label weights at the voxel centres of an image.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Label weights in bricks of 64 voxels (4x4x4 in 3D, 8x8 in 2D). A brick far from every interface is one word; the
/// others list for each of their voxels its own label first, then the others that weigh anything. Weights are fixed
/// point, so that sums at lattice points are exact and do not depend on the order of summation.
template <int Dim>
struct Bricks {
  static constexpr int kShift = Dim == 3 ? 2 : 3;
  static constexpr int kSide = 1 << kShift;
  static constexpr int kVoxels = 64;
  /// Weight of a voxel that is wholly of one label.
  static constexpr std::uint32_t kOne = 1U << 15;
  /// A reference with this bit set holds the material of a uniform brick in its low 32 bits. Any other is
  /// (chunk << 32) | (word in that chunk).
  static constexpr std::uint64_t kUniform = std::uint64_t{1} << 63;
  /// Words before the entries of a brick: 65 offsets of 16 bits, the lower half of a word first, relative to the first
  /// entry.
  static constexpr int kHeaderWords = (kVoxels + 2) / 2;

  Coord<Dim> extent{};              ///< voxels per axis
  Coord<Dim> brick_extent{};        ///< bricks per axis
  std::vector<std::uint64_t> refs;  ///< one a brick, first axis fastest
  /// Each chunk starts with its palette (materials); entries are (palette index << 16) | weight.
  std::vector<std::vector<std::uint32_t>> chunks;

  /// The entries of one voxel; `first` is the voxel's own label.
  struct Entries {
    const std::uint32_t* first;
    const std::uint32_t* last;
    const std::uint32_t* palette;
  };

  [[nodiscard]] static int place_in_brick(const Coord<Dim>& voxel) {
    int place = 0;
    for (int d = Dim; d-- > 0;) place = (place << kShift) | (voxel[d] & (kSide - 1));
    return place;
  }
  [[nodiscard]] std::int64_t brick_of(const Coord<Dim>& voxel) const {
    std::int64_t b = 0;
    for (int d = Dim; d-- > 0;) b = b * brick_extent[d] + (voxel[d] >> kShift);
    return b;
  }
  /// \pre `ref` is not uniform.
  [[nodiscard]] Entries entries(std::uint64_t ref, int place) const {
    const std::uint32_t* chunk = chunks[ref >> 32].data();
    const std::uint32_t* brick = chunk + static_cast<std::uint32_t>(ref);
    const auto offset = [brick](int p) { return brick[p >> 1] >> (16 * (p & 1)) & 0xffffU; };
    return {brick + kHeaderWords + offset(place), brick + kHeaderWords + offset(place + 1), chunk};
  }
  /// The image's material of a voxel.
  [[nodiscard]] MaterialId own(const Coord<Dim>& voxel) const {
    const std::uint64_t ref = refs[brick_of(voxel)];
    if (ref & kUniform) return static_cast<MaterialId>(ref);
    const Entries e = entries(ref, place_in_brick(voxel));
    return e.palette[*e.first >> 16];
  }
};

}  // namespace treemarch
