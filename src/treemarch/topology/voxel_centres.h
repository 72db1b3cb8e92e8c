/// \file
/// The voxels whose centres lie in a simplex.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

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

  /// Calls use(position of the voxel) for every voxel whose centre the simplex contains, its border included; only
  /// those for which wanted(position) is true are tested. Degenerate simplices contain none.
  template <class Wanted, class Use>
  void visit(const Simplex<Dim>& simplex, Wanted&& wanted, Use&& use) const {
    const VoxelBox<Dim> box = box_of(simplex);
    if (box.is_empty()) return;
    Inside inside(image_, simplex, box);
    visit_box(box, inside, wanted, use);
  }

  /// The same by blocks. \param look a Look for each block, called with its number
  template <class LookAt, class Wanted, class Use>
  void visit(const Simplex<Dim>& simplex, const Coord<Dim>& blocks, LookAt&& look, Wanted&& wanted, Use&& use) const {
    const VoxelBox<Dim> box = box_of(simplex);
    if (box.is_empty()) return;
    std::optional<Inside> inside;  // most are not looked at
    const VoxelBox<Dim> around = blocks_around(box);
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
        if (part.is_empty()) continue;
        if (!inside) inside.emplace(image_, simplex, box);
        visit_box(part, *inside, wanted, use);
      }
    });
  }

 private:
  static constexpr double kTolerance = 1e-9;  // of barycentric coordinates

  /// Barycentric coordinates along rows of voxels: linear functions tell all but the centres that are close to a facet.
  class Inside {
   public:
    Inside(const LabelImage<Dim>& image, const Simplex<Dim>& simplex, const VoxelBox<Dim>& box)
        : image_(image), simplex_(simplex), barycentric_(simplex), box_(box) {}
    [[nodiscard]] bool contains(const Coord<Dim>& voxel) const {
      return barycentric_.is_valid() && barycentric_.contains(image_.centre(voxel), kTolerance);
    }

    /// Makes it ready for rows; false where the coordinates are too steep for that.
    bool prepare() {
      if (!is_ready_) {
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
          const double slope = step_[i][0];
          const bool is_flat = std::abs(slope) < kSlack / kSteepest;
          per_slope_[i] = is_flat ? 0 : 1 / slope;
          no_low_[i] = !is_flat && slope > 0 ? 0 : -kInfinite;
          no_high_[i] = !is_flat && slope < 0 ? 0 : kInfinite;
          least_[i] = is_flat ? -2 * kSlack : -kInfinite;
        }
      }
      return is_sound_;
    }

    /// Calls f(x, is_sure) for the voxels [first, end) of a row that may lie in the simplex; is_sure() tells whether
    /// they do. \pre prepare()
    template <class F>
    void visit_row(const Coord<Dim>& first, std::int32_t end, F&& f) const {
      double low = first[0] - box_.begin[0], high = end - 1 - box_.begin[0];
      std::array<double, Dim + 1> value;  // at the begin of the box, in this row
      bool is_out = false;
      for (int i = 0; i <= Dim; ++i) {  // without branches: what a facet bounds changes from one to the next
        value[i] = at_begin_[i];
        for (int d = 1; d < Dim; ++d) value[i] += step_[i][d] * (first[d] - box_.begin[d]);
        const double x = (-kSlack - value[i]) * per_slope_[i];
        low = std::max(low, x + no_low_[i]);
        high = std::min(high, x + no_high_[i]);
        is_out |= value[i] < least_[i];
      }
      if (is_out || low > high) return;
      auto x = static_cast<std::int32_t>(low);
      if (x < low) ++x;
      for (; x <= high; ++x)
        f(box_.begin[0] + x, [&] {
          double least = 1;
          for (int i = 0; i <= Dim; ++i) least = std::min(least, value[i] + step_[i][0] * x);
          return least > kSlack;
        });
    }

   private:
    // Far above the rounding errors of coordinates up to kSteepest, far below what matters.
    static constexpr double kSlack = 1e-6, kSteepest = 1e6;
    static constexpr double kInfinite = std::numeric_limits<double>::infinity();

    const LabelImage<Dim>& image_;
    const Simplex<Dim>& simplex_;
    const Barycentric<Dim> barycentric_;
    const VoxelBox<Dim> box_;
    bool is_ready_ = false, is_sound_ = false;
    std::array<double, Dim + 1> at_begin_, per_slope_;  // 0: constant along a row
    std::array<double, Dim + 1> no_low_, no_high_;      // infinite where it bounds no row from there, else 0
    std::array<double, Dim + 1> least_;                 // in a row that is not outside altogether
    std::array<Vec<Dim>, Dim + 1> step_;
  };

  template <class Wanted, class Use>
  void visit_box(const VoxelBox<Dim>& box, Inside& inside, Wanted&& wanted, Use&& use) const {
    constexpr std::int64_t kFew = 2;                             // not worth the preparation
    const bool by_rows = box.size() > kFew && inside.prepare();  // a flat simplex is too steep
    for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t at) {
      const std::int64_t origin = at - c[0];
      const auto look = [&](std::int32_t x, auto&& is_sure) {
        if (!wanted(origin + x)) return;
        c[0] = x;
        if (is_sure() || inside.contains(c)) use(origin + x);
      };
      if (by_rows)
        inside.visit_row(c, box.end[0], look);
      else
        for (std::int32_t x = c[0]; x < box.end[0]; ++x) look(x, [] { return false; });
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
