/// \file
/// What a mesh will cost, before it is made.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

struct MeshEstimate {
  double interface_area = 0;      ///< of the faces between voxels of different materials (2D: their length), physical
  std::int64_t cells = 0;         ///< the background included
  std::int64_t memory_bytes = 0;  ///< of the whole process at its peak
};

/// Estimates for the default method, from the area of the interfaces; expect a factor of two.
/// The peak includes the image and what reading it took: the materials and a slab of samples, which is less than
/// meshing takes beside the image.
/// \param sizes where no smallest size is given, cells at interfaces have the smallest side of a voxel.
/// \param grey whether grey values are held too
template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image, const SizingRule& sizes, bool grey,
                           const Execution& execution);

/// Memory that this process can still take without paging, as the operating system and the limits of its group tell.
/// The largest number if neither says.
std::int64_t available_memory_bytes();

/// \return the bytes in "12GB", "12GiB" or "900M"; a bare number is bytes. \throw Error(usage), naming `option`
std::int64_t parse_bytes(std::string_view text, std::string_view option);

/// "about 20.0 million cells need about 3.0 GB, and 2.0 GB may be used".
std::string describe(const MeshEstimate& estimate, std::int64_t most);

/// \throw Error(limits) with the numbers if the estimate is above `most` bytes.
void require_memory(const MeshEstimate& estimate, std::int64_t most);

/// The same where what is beyond `most` goes to a file in a folder, which has room for so many bytes.
void require_disk(const MeshEstimate& estimate, std::int64_t most, std::int64_t room, const std::string& folder);

}  // namespace treemarch
