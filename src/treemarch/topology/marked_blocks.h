/// \file
/// Where in an image some of its components are, roughly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/image_components.h"

namespace treemarch {

/// Cells are passed over in groups of so many: they lie near each other.
inline constexpr std::int64_t kCellsPerGroup = 512;
inline constexpr std::int64_t kGroupsPerTask = 16;

/// The blocks of an image (image/uniform_blocks.h) that hold voxels of some of its components: where these are few,
/// they tell what need not be looked at.
template <int Dim>
class MarkedBlocks {
 public:
  /// \param wanted not 0 for each component in question \pre the image outlives the object
  MarkedBlocks(const LabelImage<Dim>& image, const ComponentMap& map, std::span<const std::uint8_t> wanted,
               const Execution& execution);

  [[nodiscard]] bool operator[](std::int64_t block) const { return marks_[static_cast<std::size_t>(block)] != 0; }
  /// Whether the box around some cells, from `begin` up to `end`, holds the centre of a voxel of a marked block.
  /// \pre the points are in the inner frame of the image
  [[nodiscard]] bool touch(const Mesh<Dim>& mesh, const CellBlock& cells, std::int64_t begin, std::int64_t end) const;

 private:
  const LabelImage<Dim>& image_;
  Coord<Dim> extent_{};
  std::vector<std::uint8_t> marks_;
};

}  // namespace treemarch
