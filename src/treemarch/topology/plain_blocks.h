/// \file
/// Blocks of voxels that one look is enough for.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/image/uniform_blocks.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {

/// The blocks of an image that are of one material and keep clear of all borders of a mesh: the centres of their voxels
/// lie in one component of the image and in one component of the mesh (or none of them lies in the mesh).
template <int Dim>
class PlainBlocks {
 public:
  /// \param uniform of the image; outlives the object. \param borders of the mesh: all facets between its materials and
  /// of its hull, which only may miss the sides of the image's box. \pre the points are in the inner frame of the image
  PlainBlocks(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const Mesh<Dim>& mesh,
              std::span<const BorderFacet> borders, const Execution& execution);
  /// None is plain. \param uniform outlives the object
  explicit PlainBlocks(const UniformBlocks<Dim>& uniform)
      : uniform_(uniform), plain_(static_cast<std::size_t>(uniform.size())) {}

  [[nodiscard]] bool operator[](std::int64_t block) const { return plain_[static_cast<std::size_t>(block)] != 0; }
  /// Material of the image in a plain block.
  [[nodiscard]] MaterialId material(std::int64_t block) const { return uniform_[block]; }
  [[nodiscard]] const Coord<Dim>& extent() const { return uniform_.extent(); }
  [[nodiscard]] std::int64_t size() const { return uniform_.size(); }

 private:
  const UniformBlocks<Dim>& uniform_;
  std::vector<std::uint8_t> plain_;
};

}  // namespace treemarch
