/// \file
/// Which leaves of a tree stay whole in a hybrid mesh. See docs/stages/hybrid.md.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {

/// What a leaf becomes. A facet of a leaf is divided into simplices exactly if it has a hanging node on its rim or one
/// of its leaves is `simplices`: so neighbours agree.
enum class LeafShape : std::uint8_t {
  simplices,   ///< simplices alone: it may be cut, and its vertices may move
  transition,  ///< its midpoint joined to its facets: pyramids over whole ones, simplices over divided ones
  box,         ///< one quad or hexahedron
};

/// The leaves that share a point with a leaf of another material. \param material one a leaf; kOutside where a leaf
/// holds several, which then counts as different from all. \return one a leaf, 1 for those.
template <int Dim>
std::vector<std::uint8_t> leaves_at_interfaces(const Spacetree<Dim>& tree, std::span<const MaterialId> material,
                                               const Execution& execution);

/// The shape of each leaf: simplices where `cut` says so, a box where all its facets stay whole, else transition.
/// For any refinement pattern and any balance. \param cut one a leaf, 1 where the surface may come
template <int Dim>
std::vector<LeafShape> choose_leaf_shapes(const Spacetree<Dim>& tree, std::span<const std::uint8_t> cut,
                                          const Execution& execution);

}  // namespace treemarch
