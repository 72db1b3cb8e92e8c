/// \file
/// Label weights at voxel centres while a field is being built.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// Label weights in bricks of 64 voxels (4x4x4 in 3D, 8x8 in 2D): a brick far from every interface is one word; the
/// others list for each voxel its own label first, then the others that weigh anything. Weights are fixed point.
template <int Dim>
struct VoxelLists {
  static constexpr int kShift = Dim == 3 ? 2 : 3;
  static constexpr int kSide = 1 << kShift;
  static constexpr int kVoxels = 64;
  /// Weight of a voxel that is wholly of one label.
  static constexpr std::uint32_t kOne = 1U << 15;

  /// A reference with this bit set holds the material of a uniform brick in its low 32 bits. Any other is
  /// (chunk << 32) | (word in that chunk).
  static constexpr std::uint64_t kUniform = std::uint64_t{1} << 63;
  /// A brick starts with 65 offsets of 16 bits, the lower half of a word first, relative to the first entry; then come
  /// the entries (index in the chunk's palette << 16) | weight.
  static constexpr int kHeader = (kVoxels + 2) / 2;

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
  /// Calls visit(material, weight) for the entries of a voxel, its own label first. Weights are in units of 1 / kOne
  /// and may be 0.
  template <class Visit>
  void visit_voxel(std::uint64_t ref, int place, Visit&& visit) const {
    if (ref & kUniform) {
      visit(static_cast<MaterialId>(ref), kOne);
      return;
    }
    const std::uint32_t* palette = chunks[ref >> 32].data();
    const std::uint32_t* brick = palette + static_cast<std::uint32_t>(ref);
    const std::uint32_t* last = brick + kHeader + offset(brick, place + 1);
    for (const std::uint32_t* p = brick + kHeader + offset(brick, place); p != last; ++p)
      visit(palette[*p >> 16], *p & 0xffffU);
  }

  /// Gives a voxel's own label all the weight there is, in units of 1 / kOne. \pre weight < 2 * kOne
  void make_raw(std::uint64_t ref, int place, std::uint32_t weight) {
    if (ref & kUniform) return;
    std::uint32_t* brick = chunks[ref >> 32].data() + static_cast<std::uint32_t>(ref);
    const std::uint32_t first = offset(brick, place);
    const std::uint32_t last = offset(brick, place + 1);
    for (std::uint32_t i = first; i < last; ++i) {
      std::uint32_t& word = brick[kHeader + i];
      word = (word & 0xffff0000U) | (i == first ? weight : 0U);
    }
  }

  /// Multiplies the weights of a brick by the factors of their materials, up to the largest weight there is.
  void rescale(std::uint64_t ref, const std::vector<float>& factor) {
    if (ref & kUniform) return;
    const std::uint32_t* palette = chunks[ref >> 32].data();
    std::uint32_t* brick = chunks[ref >> 32].data() + static_cast<std::uint32_t>(ref);
    for (std::uint32_t i = 0; i < offset(brick, kVoxels); ++i) {
      std::uint32_t& word = brick[kHeader + i];
      const float weight = static_cast<float>(word & 0xffffU) * factor[palette[word >> 16]];
      word = (word & 0xffff0000U) | static_cast<std::uint32_t>(std::min(65535.0F, weight + 0.5F));
    }
  }

 private:
  static std::uint32_t offset(const std::uint32_t* brick, int place) {
    return brick[place >> 1] >> (16 * (place & 1)) & 0xffffU;
  }
};

}  // namespace treemarch
