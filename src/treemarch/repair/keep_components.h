/// \file
/// Anchors that keep the components of an image whole while vertices move.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/improve/anchors.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/repair/bridge.h"
#include "treemarch/topology/component_fates.h"
#include "treemarch/topology/image_components.h"
#include "treemarch/topology/mesh_components.h"

namespace treemarch {

/// Of each small component of the image (up to 64 cells of mean size) the centre that is deepest in a cell of its
/// label: moves could uncover all of its voxels. By component. \param required one a component of the image: whether it
/// gets an anchor \pre the materials of the mesh are those of the image, and it has one block, of simplices
template <int Dim>
std::vector<HeldAnchor> keep_small(const LabelImage<Dim>& image, const ComponentMap& map,
                                   std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                                   const Execution& execution);

/// Voxels near a part of a material that belong to another part of it, and those beside them: a part that came to hold
/// one of them would split a component of the image. Parts that have been joined are one. Anchors that are not inside,
/// in no order. Voxels further than two voxels from the cells of a part are not listed: vertices hardly move that far.
/// \param fates of the components of the image in the mesh, before any were mended
/// \param broken those of them that have been mended, or would have to be \param changed cells that got another
/// material since, in any order \pre as for keep_small()
template <int Dim>
std::vector<Anchor> keep_apart(const ComponentFates& fates, const BrokenComponents<Dim>& broken,
                               std::vector<CellId> changed, const Mesh<Dim>& mesh, const Execution& execution);

}  // namespace treemarch
