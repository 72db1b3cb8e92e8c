/// \file
/// Sparse storage of label weights at the voxel centres of an image.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Label weights in bricks of 64 voxels (4x4x4 in 3D, 8x8 in 2D), in one of three forms: a brick far from every
/// interface is one word; a brick of two labels holds both weights of every voxel; the others list for each voxel its
/// own label first, then the others that weigh anything. Weights are fixed point, so that sums at lattice points are
/// exact and do not depend on the order of summation.
template <int Dim>
struct Bricks {
  static constexpr int kShift = Dim == 3 ? 2 : 3;
  static constexpr int kSide = 1 << kShift;
  static constexpr int kVoxels = 64;
  /// Weight of a voxel that is wholly of one label.
  static constexpr std::uint32_t kOne = 1U << 15;

  /// A reference with this bit set holds the material of a uniform brick in its low 32 bits. Any other is
  /// (chunk << 32) | (word in that chunk), with kPair added for a brick of two labels.
  static constexpr std::uint64_t kUniform = std::uint64_t{1} << 63;
  static constexpr std::uint64_t kPair = std::uint64_t{1} << 62;

  /// A brick of two labels: their materials in two words, one bit a voxel in two more, set where the second is the
  /// voxel's own, then one word a voxel: (weight of the second << 16) | weight of the first.
  static constexpr int kPairHeader = 4;
  /// A brick of lists: 65 offsets of 16 bits, the lower half of a word first, relative to the first entry; then the
  /// entries (index in the chunk's palette << 16) | weight.
  static constexpr int kListHeader = (kVoxels + 2) / 2;

  Coord<Dim> extent{};              ///< voxels per axis
  Coord<Dim> brick_extent{};        ///< bricks per axis
  std::vector<std::uint64_t> refs;  ///< one a brick, first axis fastest
  /// Each chunk starts with its palette (materials).
  std::vector<std::vector<std::uint32_t>> chunks;

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
  /// First word of a brick. \pre `ref` is not uniform.
  [[nodiscard]] const std::uint32_t* data(std::uint64_t ref) const {
    return chunk_of(ref).data() + static_cast<std::uint32_t>(ref);
  }

  /// Calls visit(material, weight) for what weighs anything at a voxel. Weights are in units of 1 / kOne.
  template <class Visit>
  void visit_voxel(std::uint64_t ref, int place, Visit&& visit) const {
    if (ref & kUniform) {
      visit(static_cast<MaterialId>(ref), kOne);
      return;
    }
    const std::uint32_t* brick = data(ref);
    if (ref & kPair) {
      const std::uint32_t word = brick[kPairHeader + place];
      if ((word & 0xffffU) != 0) visit(brick[0], word & 0xffffU);
      if (word >> 16 != 0) visit(brick[1], word >> 16);
      return;
    }
    const std::uint32_t* palette = chunk_of(ref).data();
    const std::uint32_t* last = brick + kListHeader + list_offset(brick, place + 1);
    for (const std::uint32_t* p = brick + kListHeader + list_offset(brick, place); p != last; ++p)
      if ((*p & 0xffffU) != 0) visit(palette[*p >> 16], *p & 0xffffU);
  }

  /// The image's material of a voxel.
  [[nodiscard]] MaterialId own(const Coord<Dim>& voxel) const {
    const std::uint64_t ref = refs[brick_of(voxel)];
    if (ref & kUniform) return static_cast<MaterialId>(ref);
    const std::uint32_t* brick = data(ref);
    const int place = place_in_brick(voxel);
    if (ref & kPair) return brick[brick[2 + place / 32] >> (place % 32) & 1U];
    return chunk_of(ref)[brick[kListHeader + list_offset(brick, place)] >> 16];
  }

  /// Gives a voxel's own label the whole weight.
  void make_raw(std::uint64_t ref, int place) {
    if (ref & kUniform) return;
    std::uint32_t* brick = chunks[chunk_index(ref)].data() + static_cast<std::uint32_t>(ref);
    if (ref & kPair) {
      const bool second = (brick[2 + place / 32] >> (place % 32) & 1U) != 0;
      brick[kPairHeader + place] = second ? kOne << 16 : kOne;
      return;
    }
    const std::uint32_t first = list_offset(brick, place);
    const std::uint32_t last = list_offset(brick, place + 1);
    for (std::uint32_t i = first; i < last; ++i) {
      std::uint32_t& word = brick[kListHeader + i];
      word = (word & 0xffff0000U) | (i == first ? kOne : 0U);
    }
  }

 private:
  static std::uint32_t list_offset(const std::uint32_t* brick, int place) {
    return brick[place >> 1] >> (16 * (place & 1)) & 0xffffU;
  }
  static std::size_t chunk_index(std::uint64_t ref) { return (ref & ~kPair) >> 32; }
  [[nodiscard]] const std::vector<std::uint32_t>& chunk_of(std::uint64_t ref) const { return chunks[chunk_index(ref)]; }
};

}  // namespace treemarch
