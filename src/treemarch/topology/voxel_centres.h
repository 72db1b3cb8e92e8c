/// \file
/// The voxels whose centres lie in a simplex.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "treemarch/image/label_image.h"
#include "treemarch/image/uniform_blocks.h"
#include "treemarch/mesh/simplex_quality.h"
#include "treemarch/topology/simplices.h"

namespace treemarch {

/// Which voxels of a block are visited: of a plain one (PlainBlocks) the first stands for all of them.
enum class Look : std::uint8_t { nowhere, at_first, at_all };

/// Visits voxel centres in simplices of the inner frame of an image.
template <int Dim>
class VoxelCentres {
 public:
  /// \pre `image` outlives the object
  explicit VoxelCentres(const LabelImage<Dim>& image) : image_(image) {
    for (int d = 0; d < Dim; ++d) voxels_per_length_[d] = 1 / image.frame.spacing[d];
  }

  /// Calls use(position of the voxel) for every voxel whose centre the simplex contains, its border included, and for
  /// which wanted(position) is true. Degenerate simplices contain none.
  template <class Wanted, class Use>
  void visit(const Simplex<Dim>& simplex, Wanted&& wanted, Use&& use) const {
    const VoxelBox<Dim> box = box_of(simplex);
    if (box.is_empty()) return;
    Inside inside(image_, simplex, box);
    visit_box(box, inside, wanted, use);
  }

  /// The same by blocks. \param look a Look for each block, called with its number, maybe more than once
  template <class LookAt, class Wanted, class Use>
  void visit(const Simplex<Dim>& simplex, const Coord<Dim>& blocks, LookAt&& look, Wanted&& wanted, Use&& use) const {
    const VoxelBox<Dim> box = box_of(simplex);
    if (box.is_empty()) return;
    Inside inside(image_, simplex, box);
    const VoxelBox<Dim> around = blocks_around(box);
    bool whole = true;
    for_each_row(around, blocks, [&](const Coord<Dim>& block, std::int64_t at) {
      for (std::int64_t b = at; b < at + around.end[0] - block[0]; ++b) whole &= look(b) == Look::at_all;
    });
    if (whole) return visit_box(box, inside, wanted, use);
    for_each_row(around, blocks, [&](Coord<Dim> block, std::int64_t at) {
      for (; block[0] < around.end[0]; ++block[0], ++at) {
        const Look how = look(at);
        if (how == Look::nowhere) continue;
        VoxelBox<Dim> part;
        for (int d = 0; d < Dim; ++d) {
          const std::int32_t first = block[d] << UniformBlocks<Dim>::kShift;
          part.begin[d] = std::max(first, box.begin[d]);
          part.end[d] = std::min(first + (how == Look::at_first ? 1 : UniformBlocks<Dim>::kSide), box.end[d]);
        }
        if (!part.is_empty()) visit_box(part, inside, wanted, use);
      }
    });
  }

 private:
  static constexpr double kTolerance = 1e-9;  // of barycentric coordinates
  static constexpr int kLanes = 4;            // voxels of a row that are looked at together
  using Lanes [[gnu::vector_size(kLanes * sizeof(double))]] = double;

  /// Barycentric coordinates as linear functions, which tell all centres but those that are as far outside as is just
  /// tolerated.
  class Inside {
   public:
    Inside(const LabelImage<Dim>& image, const Simplex<Dim>& simplex, const VoxelBox<Dim>& box)
        : image_(image), simplex_(simplex), box_(box) {}
    [[nodiscard]] bool contains(const Coord<Dim>& voxel) const {
      const Barycentric<Dim> barycentric(simplex_);
      return barycentric.is_valid() && barycentric.contains(image_.centre(voxel), kTolerance);
    }

    /// Makes it ready for rows; false where the coordinates are too steep for that.
    bool prepare() {
      if (is_ready_) return is_sound_;
      is_ready_ = true;
      const std::array<Vec<Dim>, Dim + 1> gradient = inward_normals<Dim>(simplex_);
      const double scale = 1 / dot(gradient[1], simplex_[1] - simplex_[0]);
      const Vec<Dim> origin = image_.centre(box_.begin) - simplex_[0];
      is_sound_ = true;
      for (int i = 0; i <= Dim; ++i) {
        at_begin_[i] = dot(gradient[i], origin) * scale + (i == 0 ? 1 : 0);
        double range = std::abs(at_begin_[i]);
        for (int d = 0; d < Dim; ++d) {
          step_[i][d] = gradient[i][d] * scale * image_.frame.spacing[d];
          range += std::abs(step_[i][d]) * (box_.end[d] - box_.begin[d]);
        }
        is_sound_ &= range < kSteepest;
      }
      return is_sound_;
    }

    /// Looks at voxels from `first` along a row, as many as there are lanes: bits of those that lie in the simplex, and
    /// of those where contains() must tell. \pre prepare()
    void look(const Coord<Dim>& first, unsigned& in, unsigned& open) const {
      constexpr Lanes kRamp = {0, 1, 2, 3};
      Lanes least = Lanes{} + 1;
      for (int i = 0; i <= Dim; ++i) {
        double value = at_begin_[i];
        for (int d = 0; d < Dim; ++d) value += step_[i][d] * (first[d] - box_.begin[d]);
        const Lanes x = value + step_[i][0] * kRamp;
        least = x < least ? x : least;
      }
      in = open = 0;
      for (int k = 0; k < kLanes; ++k) {
        in |= unsigned{least[k] > kErrors - kTolerance} << k;
        open |= unsigned{std::abs(least[k] + kTolerance) <= kErrors} << k;
      }
    }

   private:
    // Far above the rounding errors of coordinates up to kSteepest, far below the tolerance.
    static constexpr double kErrors = 1e-10, kSteepest = 1e4;

    const LabelImage<Dim>& image_;
    const Simplex<Dim>& simplex_;
    const VoxelBox<Dim> box_;
    bool is_ready_ = false, is_sound_ = false;
    std::array<double, Dim + 1> at_begin_;
    std::array<Vec<Dim>, Dim + 1> step_;
  };

  /// Bits of voxels are gathered from several rows before any is used: which are set cannot be foreseen.
  template <class Wanted, class Use>
  void visit_box(const VoxelBox<Dim>& box, Inside& inside, Wanted&& wanted, Use&& use) const {
    if (!inside.prepare()) return visit_flat(box, inside, wanted, use);
    constexpr int kRuns = 64 / kLanes;
    std::array<std::int64_t, kRuns> start;
    std::uint64_t in = 0, open = 0;
    int runs = 0;
    const auto flush = [&] {
      for (std::uint64_t left = in | open; left != 0; left &= left - 1) {
        const int bit = std::countr_zero(left);
        const std::int64_t v = start[static_cast<std::size_t>(bit / kLanes)] + bit % kLanes;
        if (!wanted(v)) continue;
        if ((in >> bit & 1U) != 0 || inside.contains(coord_of(v, image_.extent))) use(v);
      }
      in = open = 0;
      runs = 0;
    };
    for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t at) {
      for (; c[0] < box.end[0]; c[0] += kLanes, at += kLanes) {
        unsigned is_in, is_open;
        inside.look(c, is_in, is_open);
        const unsigned of_row = (1U << std::min(kLanes, box.end[0] - c[0])) - 1;
        in |= std::uint64_t{is_in & of_row} << runs * kLanes;
        open |= std::uint64_t{is_open & of_row} << runs * kLanes;
        start[static_cast<std::size_t>(runs)] = at;
        if (++runs == kRuns) flush();
      }
    });
    flush();
  }

  /// Of a simplex that is flat or almost.
  template <class Wanted, class Use>
  void visit_flat(const VoxelBox<Dim>& box, const Inside& inside, Wanted&& wanted, Use&& use) const {
    for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t at) {
      for (; c[0] < box.end[0]; ++c[0], ++at)
        if (wanted(at) && inside.contains(c)) use(at);
    });
  }

  /// Voxels whose centres lie between the planes around a simplex, within the image.
  [[nodiscard]] VoxelBox<Dim> box_of(const Simplex<Dim>& simplex) const {
    constexpr double kSlack = 1e-9;
    Vec<Dim> low = simplex[0], high = low;
    for (const Vec<Dim>& p : simplex)
      for (int d = 0; d < Dim; ++d) {
        low[d] = std::min(low[d], p[d]);
        high[d] = std::max(high[d], p[d]);
      }
    return centres_between(low, high, voxels_per_length_, image_.extent, kSlack);
  }

  const LabelImage<Dim>& image_;
  Vec<Dim> voxels_per_length_{};
};

}  // namespace treemarch
