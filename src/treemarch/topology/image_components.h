/// \file
/// Connected components of the materials of an image.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/marks.h"

namespace treemarch {

/// A set of voxels of one material that are connected over faces.
struct ImageComponent {
  MaterialId material = 0;
  std::int64_t voxels = 0;
  std::int64_t first_voxel = 0;  ///< its first in scan order
};

/// All components, by their first voxels. Works on runs along the first axis, in almost linear time.
/// \throw Error(limits) if there are 2^32 runs or more.
template <int Dim>
std::vector<ImageComponent> image_components(const LabelImage<Dim>& image, const Execution& execution);

/// Index of the largest component of each material, the first one of several; -1 for a material without any.
std::vector<std::int64_t> largest_components(const std::vector<ImageComponent>& components, std::size_t materials);

/// The same as image_components(), and the component of each voxel as an index into them. Kept as runs: far less memory
/// than a number a voxel.
struct ComponentMap {
  /// A stretch of one component along the first axis, up to the next.
  struct Run {
    std::int32_t begin;
    std::uint32_t component;
  };
  std::vector<ImageComponent> components;
  std::int64_t width = 0;              ///< voxels along the first axis
  std::vector<Run> runs;               ///< in scan order
  std::vector<std::size_t> row_begin;  ///< first run of each row, and the end

  /// \param voxel its linear index in the image
  [[nodiscard]] std::uint32_t of(std::int64_t voxel) const {
    const auto row = static_cast<std::size_t>(voxel / width);
    const auto x = static_cast<std::int32_t>(voxel % width);
    const auto first = runs.begin() + static_cast<std::ptrdiff_t>(row_begin[row]);
    const auto last = runs.begin() + static_cast<std::ptrdiff_t>(row_begin[row + 1]);
    return std::prev(std::upper_bound(first, last, x, [](std::int32_t at, const Run& r) { return at < r.begin; }))
        ->component;
  }
  /// Calls visit(begin, end, component) for the runs of a row of voxels.
  template <class Visit>
  void for_runs(std::size_t row, Visit&& visit) const {
    for (std::size_t r = row_begin[row]; r < row_begin[row + 1]; ++r)
      visit(std::int64_t{runs[r].begin}, r + 1 < row_begin[row + 1] ? std::int64_t{runs[r + 1].begin} : width,
            runs[r].component);
  }
  /// The voxels of the components for which wanted(component) is true.
  template <class Wanted>
  [[nodiscard]] Marks voxels_of(Wanted&& wanted) const {
    const std::size_t rows = row_begin.size() - 1;
    Marks marks(rows * static_cast<std::size_t>(width));
    for (std::size_t row = 0; row < rows; ++row)
      for_runs(row, [&](std::int64_t begin, std::int64_t end, std::uint32_t component) {
        if (wanted(component))
          marks.mark_run(row * static_cast<std::size_t>(width) + static_cast<std::size_t>(begin),
                         static_cast<std::size_t>(end - begin));
      });
    return marks;
  }
};

template <int Dim>
ComponentMap map_components(const LabelImage<Dim>& image, const Execution& execution);

}  // namespace treemarch
