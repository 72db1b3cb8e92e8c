/// \file
/// Where the boundary of a material is no manifold: in a mesh and in the image itself.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// A vertex of a mesh where a material touches itself: along an edge that four of its boundary's facets share, or in a
/// point only.
struct MeshPinch {
  VertexId vertex = 0;
  MaterialId material = 0;
  int sheets = 0;  ///< of its boundary beyond one, at least 1 (VertexLink::Excess)
};

/// All pinches among the vertices with a value other than 0 in `among` (one a point), by vertex, then by material. The
/// hull belongs to the boundary of a material. The same for any number of threads.
template <int Dim>
std::vector<MeshPinch> find_mesh_pinches(const Mesh<Dim>& mesh, std::span<const std::uint8_t> among,
                                         const Execution& execution);

/// A corner of voxels where the voxels of a material touch themselves along an edge or in a point only, or its
/// complement does.
struct ImagePinch {
  std::int64_t corner = 0;  ///< position among the corners of voxels, (extent + 1) an axis, first axis fastest
  MaterialId material = 0;
};

/// All pinches of an image, by corner, then by material.
template <int Dim>
std::vector<ImagePinch> find_image_pinches(const LabelImage<Dim>& image, const Execution& execution);

}  // namespace treemarch
