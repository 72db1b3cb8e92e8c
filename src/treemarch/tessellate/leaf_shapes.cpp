#include "treemarch/tessellate/leaf_shapes.h"

#include <array>
#include <atomic>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 2048;  // leaves a block of the parallel loops

/// The leaves around a point, in the order of their octants; kNoLeaf beyond the box.
template <int Dim>
std::array<LeafId, 1 << Dim> leaves_around(const Spacetree<Dim>& tree, const Coord<Dim>& point) {
  std::array<LeafId, 1 << Dim> around;
  for (int octant = 0; octant < 1 << Dim; ++octant) {
    Coord<Dim> cell = point;
    for (int d = 0; d < Dim; ++d) cell[d] -= ~octant >> d & 1;
    around[octant] = tree.leaf_at(cell);
  }
  return around;
}

template <int Dim>
Coord<Dim> corner_of(const Spacetree<Dim>& tree, const Leaf<Dim>& leaf, int corner) {
  Coord<Dim> point = leaf.corner;
  for (int d = 0; d < Dim; ++d) point[d] += (corner >> d & 1) * tree.extent_of(leaf)[d];
  return point;
}

/// Whether a vertex lies on an edge of the leaf, between its ends. The grids of the levels are nested: a smaller leaf
/// beside an edge is smaller at the lower end of it already.
template <int Dim>
bool has_hanging_node(const Spacetree<Dim>& tree, const Leaf<Dim>& leaf) {
  for (int axis = 0; axis < Dim; ++axis) {
    const std::int32_t side = tree.extent_of(leaf)[axis];
    if (side == 1) continue;
    for (int corner = 0; corner < 1 << Dim; ++corner) {
      if (corner >> axis & 1) continue;
      const auto around = leaves_around(tree, corner_of(tree, leaf, corner));
      for (int octant = 1 << axis, n = 0; n < 1 << (Dim - 1); ++n, octant = (octant + 1) | 1 << axis) {
        const LeafId next = around[octant];
        if (next != kNoLeaf && tree.extent_of(tree.leaves[next])[axis] < side) return true;
      }
    }
  }
  return false;
}

/// Whether a leaf that shares a facet of Dim - 1 >= 2 dimensions is cut. In the plane a facet is a line, and whole
/// anyway. \pre no hanging node: then one leaf lies at each facet
template <int Dim>
bool has_divided_facet(const Spacetree<Dim>& tree, const Leaf<Dim>& leaf, std::span<const std::uint8_t> cut) {
  if constexpr (Dim >= 3) {
    for (int axis = 0; axis < Dim; ++axis)
      for (const bool up : {false, true}) {
        Coord<Dim> beyond = leaf.corner;
        beyond[axis] += up ? tree.extent_of(leaf)[axis] : -1;
        const LeafId next = tree.leaf_at(beyond);
        if (next != kNoLeaf && cut[next]) return true;
      }
  }
  return false;
}

}  // namespace

template <int Dim>
std::vector<std::uint8_t> leaves_at_interfaces(const Spacetree<Dim>& tree, std::span<const MaterialId> material,
                                               const Execution& execution) {
  // Where two leaves touch, a corner of one of them does, since the grids of the levels are nested.
  std::vector<std::uint8_t> found(tree.leaves.size(), 0);
  parallel_for(execution, static_cast<std::int64_t>(found.size()), kBlock, [&](std::int64_t i) {
    const Leaf<Dim>& leaf = tree.leaves[i];
    for (int corner = 0; corner < 1 << Dim; ++corner) {
      const auto around = leaves_around(tree, corner_of(tree, leaf, corner));
      bool mixed = material[i] == kOutside;
      for (const LeafId n : around) mixed |= n != kNoLeaf && material[n] != material[i];
      if (!mixed) continue;
      for (const LeafId n : around)
        if (n != kNoLeaf) std::atomic_ref(found[n]).store(1, std::memory_order_relaxed);
    }
  });
  return found;
}

template <int Dim>
std::vector<LeafShape> choose_leaf_shapes(const Spacetree<Dim>& tree, std::span<const std::uint8_t> cut,
                                          const Execution& execution) {
  std::vector<LeafShape> shapes(tree.leaves.size(), LeafShape::simplices);
  parallel_for(execution, static_cast<std::int64_t>(shapes.size()), kBlock, [&](std::int64_t i) {
    if (cut[i]) return;
    const Leaf<Dim>& leaf = tree.leaves[i];
    const bool whole = !has_hanging_node(tree, leaf) && !has_divided_facet(tree, leaf, cut);
    shapes[i] = whole ? LeafShape::box : LeafShape::transition;
  });
  return shapes;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                            \
  template std::vector<std::uint8_t> leaves_at_interfaces(const Spacetree<DIM>&, std::span<const MaterialId>, \
                                                          const Execution&);                                  \
  template std::vector<LeafShape> choose_leaf_shapes(const Spacetree<DIM>&, std::span<const std::uint8_t>,    \
                                                     const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
