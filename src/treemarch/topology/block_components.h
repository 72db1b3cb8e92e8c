/// \file
/// Which components of an image are where, roughly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/image/label_image.h"
#include "treemarch/topology/image_components.h"

namespace treemarch {

/// The components that have voxels in each block of an image (image/uniform_blocks.h).
template <int Dim>
class BlockComponents {
 public:
  /// \param wanted not 0 for each component in question
  BlockComponents(const LabelImage<Dim>& image, const ComponentMap& map, std::span<const std::uint8_t> wanted,
                  const Execution& execution);

  /// Blocks along each axis.
  [[nodiscard]] const Coord<Dim>& extent() const { return extent_; }
  /// Ascending.
  [[nodiscard]] std::span<const std::uint32_t> operator[](std::int64_t block) const {
    const auto b = static_cast<std::size_t>(block);
    return std::span(components_).subspan(first_[b], first_[b + 1] - first_[b]);
  }

 private:
  Coord<Dim> extent_{};
  std::vector<std::size_t> first_;  // of each block, and the end
  RawVector<std::uint32_t> components_;
};

}  // namespace treemarch
