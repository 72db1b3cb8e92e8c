#include "treemarch/tessellate/body_centred.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <limits>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 2048;  // leaves

/// Corners of a face in the order in which they go around it, counter-clockwise about +axis (2D: from lower to upper
/// end).
template <int Dim>
constexpr std::array<int, 1 << (Dim - 1)> face_ring(int axis, int up) {
  const int base = up << axis;
  if constexpr (Dim == 2) {
    return {base, base | 1 << (1 - axis)};
  } else {
    const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
    return {base, base | u, base | u | v, base | v};
  }
}

template <int Dim>
Coord<Dim> centre_of(const Leaf<Dim>& leaf, std::int32_t side) {
  Coord<Dim> centre{};
  for (int d = 0; d < Dim; ++d) centre[d] = 2 * leaf.corner[d] + side;
  return centre;
}

/// The point that is `half` away from `from`, downwards along the axes whose bit is not set.
template <int Dim>
Coord<Dim> corner_of(const Coord<Dim>& from, std::int32_t half, int bits) {
  Coord<Dim> p = from;
  for (int d = 0; d < Dim; ++d) p[d] += bits >> d & 1 ? half : -half;
  return p;
}

template <int Dim>
Coord<Dim> shifted(Coord<Dim> p, int axis, std::int32_t by) {
  p[axis] += by;
  return p;
}

/// A leaf of the smallest side, by far the most frequent: its vertices are found by steps from bit to bit.
template <int Dim>
void find_vertices_of_finest(const SimplexLattice<Dim>& lattice, const Leaf<Dim>& leaf, LeafStar<Dim>& star) {
  const auto& points = lattice.points;
  const RankedBits& bits = points.bits();
  const std::int64_t corner = points.even_key(leaf.corner), centre = points.odd_key(leaf.corner);
  star.centre = bits.rank(centre);
  for (int c = 0; c < LeafStar<Dim>::kCorners; c += 2) {
    std::int64_t key = corner;
    for (int d = 1; d < Dim; ++d) key += c >> d & 1 ? points.even_stride(d) : 0;
    star.corner[c] = bits.rank(key);
    star.corner[c + 1] = star.corner[c] + 1;
  }
  if constexpr (Dim == 3) {
    star.plain = true;
    for (int axis = 0; axis < Dim; ++axis)
      for (int up = 0; up < 2; ++up) {
        const bool on_hull = up ? leaf.corner[axis] + 1 == points.cells()[axis] : leaf.corner[axis] == 0;
        const std::int64_t beyond = centre + (up ? points.odd_stride(axis) : -points.odd_stride(axis));
        if (!on_hull && bits.contains(beyond)) {  // a neighbour of the same size
          if (up) star.across[2 * axis + up] = axis == 0 ? star.centre + 1 : bits.rank(beyond);
          continue;
        }
        star.plain = false;
        Coord<Dim> at = centre_of(leaf, 1);
        if (on_hull) {
          at[axis] += up ? 1 : -1;
        } else {
          for (int d = 0; d < Dim; ++d) at[d] = 4 * ((leaf.corner[d] + (d == axis ? 2 * up - 1 : 0)) >> 1) + 2;
          star.split |= 1U << (2 * axis + up);
        }
        star.across[2 * axis + up] = points.id(at);
      }
  }
}

/// Any other leaf. A face has smaller neighbours where its centre is a vertex, an edge is halved where its middle is.
/// All these points are even: their places among the bits are as far apart as they are.
template <int Dim>
void find_vertices_of_coarse(const SimplexLattice<Dim>& lattice, const Leaf<Dim>& leaf, std::int32_t side,
                             LeafStar<Dim>& star) {
  using Star = LeafStar<Dim>;
  const auto& points = lattice.points;
  const RankedBits& bits = points.bits();
  std::array<std::int64_t, Dim> half;  // a half side along each axis
  std::int64_t centre = points.even_key(leaf.corner);
  for (int d = 0; d < Dim; ++d) centre += half[d] = side / 2 * points.even_stride(d);
  star.centre = bits.rank(centre);
  std::array<std::int64_t, Star::kCorners> corner;
  for (int c = 0; c < Star::kCorners; ++c) {
    corner[c] = centre;
    for (int d = 0; d < Dim; ++d) corner[c] += c >> d & 1 ? half[d] : -half[d];
    star.corner[c] = bits.rank(corner[c]);
  }
  for (int a = 0; a < Star::kCorners; ++a)
    for (int d = 0; d < Dim; ++d) {
      const int b = a | 1 << d;
      if (a == b) continue;
      const std::int64_t middle = corner[a] + half[d];
      const bool halved = bits.contains(middle);
      star.middle[Star::edge_between(a, b)] = halved ? bits.rank(middle) : Star::kNone;
      star.hanging |= halved;
    }
  if constexpr (Dim == 3) {
    for (int axis = 0; axis < Dim; ++axis)
      for (int up = 0; up < 2; ++up) {
        VertexId& across = star.across[2 * axis + up];
        const std::int64_t to_face = up ? half[axis] : -half[axis];
        const bool on_hull = up ? leaf.corner[axis] + side == points.cells()[axis] : leaf.corner[axis] == 0;
        if (on_hull) {
          across = bits.rank(centre + to_face);
          continue;
        }
        if (bits.contains(centre + to_face)) continue;
        if (bits.contains(centre + 2 * to_face)) {
          if (up) across = bits.rank(centre + 2 * to_face);
          continue;
        }
        Coord<Dim> larger = leaf.corner;
        larger[axis] += up ? side : -side;
        for (int d = 0; d < Dim; ++d) larger[d] = 4 * side * (larger[d] / (2 * side)) + 2 * side;
        across = points.even_id(larger);
        star.split |= 1U << (2 * axis + up);
      }
  }
}

/// The face's rim is joined to the two points on both sides of it: {below, a, b, above} for each of its segments.
template <int Dim, class Emit>
void for_rim(const LeafStar<Dim>& star, int axis, int up, Emit&& emit) {
  const auto ring = face_ring<Dim>(axis, up);
  constexpr int kSegments = Dim == 2 ? 1 : 4;
  for (int k = 0; k < kSegments; ++k) {
    const int from = ring[k], to = ring[(k + 1) % ring.size()];
    const VertexId a = star.corner[from], b = star.corner[to];
    const VertexId m = star.hanging ? star.middle[LeafStar<Dim>::edge_between(from, to)] : LeafStar<Dim>::kNone;
    if (m == LeafStar<Dim>::kNone) {
      emit(a, b);
    } else {
      emit(a, m);
      emit(m, b);
    }
  }
}

/// The small face is split by the diagonal through the centre of the big one, and both triangles are joined to both
/// centres: the other diagonal would give 35 to 125 degrees.
template <class Emit>
void face_between_levels(const LeafStar<3>& star, int axis, int up, Emit&& emit) {
  const auto ring = face_ring<3>(axis, up);
  // The centre of the big face is that corner of the small one that is not on the big one's rim.
  const int through = (~static_cast<int>(star.up) & 7 & ~(1 << axis)) | up << axis;
  const int k = static_cast<int>(std::find(ring.begin(), ring.end(), through) - ring.begin());
  const VertexId big = star.across[2 * axis + up], below = up ? star.centre : big, above = up ? big : star.centre;
  for (const int second : {1, 2}) {
    const VertexId a = star.corner[through], b = star.corner[ring[(k + second) % 4]],
                   c = star.corner[ring[(k + second + 1) % 4]];
    emit({below, a, b, c});
    emit({above, a, c, b});
  }
}

/// Calls emit(simplex) for those of one face.
template <int Dim, class Emit>
void for_simplices(const LeafStar<Dim>& star, int face, Emit&& emit) {
  using Simplex = typename LeafStar<Dim>::Simplex;
  const int axis = face / 2, upper = face % 2;
  if constexpr (Dim == 2) {
    for_rim(star, axis, upper, [&](VertexId a, VertexId b) {
      emit((axis == 0) == (upper == 1) ? Simplex{star.centre, a, b} : Simplex{star.centre, b, a});
    });
  } else {
    const VertexId across = star.across[face];
    if (across == LeafStar<Dim>::kNone) return;
    if (star.split >> face & 1)
      face_between_levels(star, axis, upper, emit);
    else
      for_rim(star, axis, upper, [&](VertexId a, VertexId b) {
        emit(upper ? Simplex{star.centre, a, b, across} : Simplex{star.centre, b, a, across});
      });
  }
}

}  // namespace

template <int Dim>
int LeafStar<Dim>::simplices(std::array<Simplex, kMostSimplices>& out) const {
  int n = 0;
  for (int face = 0; face < kFaces; ++face) for_simplices(*this, face, [&](const Simplex& s) { out[n++] = s; });
  return n;
}

template <int Dim>
int LeafStar<Dim>::simplices(int face, std::array<Simplex, kMostSimplices>& out) const {
  int n = 0;
  for_simplices(*this, face, [&](const Simplex& s) { out[n++] = s; });
  return n;
}

template <int Dim>
std::array<VertexId, LeafStar<Dim>::kCorners / 2> LeafStar<Dim>::rim(int face) const {
  std::array<VertexId, kCorners / 2> round;
  const auto ring = face_ring<Dim>(face / 2, face % 2);
  for (std::size_t k = 0; k < ring.size(); ++k) round[k] = corner[ring[k]];
  return round;
}

template <int Dim>
bool LeafStar<Dim>::is_halved(int face) const {
  if (!hanging) return false;
  const auto ring = face_ring<Dim>(face / 2, face % 2);
  for (std::size_t k = 0; k < ring.size(); ++k)
    if (middle[edge_between(ring[k], ring[(k + 1) % ring.size()])] != kNone) return true;
  return false;
}

template <int Dim>
std::array<VertexId, LeafStar<Dim>::kCorners> LeafStar<Dim>::box() const {
  constexpr std::array<int, 8> kOrder{0, 1, 3, 2, 4, 5, 7, 6};
  std::array<VertexId, kCorners> cell;
  for (int k = 0; k < kCorners; ++k) cell[k] = corner[kOrder[k]];
  return cell;
}

template <int Dim>
LeafStar<Dim> SimplexLattice<Dim>::star(LeafId id) const {
  const Leaf<Dim>& leaf = leaves[id];
  const std::int32_t side = sides[leaf.level];
  LeafStar<Dim> star;
  star.across.fill(LeafStar<Dim>::kNone);
  for (int d = 0; d < Dim; ++d) star.up |= (leaf.corner[d] & side ? 1U : 0U) << d;
  if (side == 1)
    find_vertices_of_finest(*this, leaf, star);
  else
    find_vertices_of_coarse(*this, leaf, side, star);
  return star;
}

namespace {

template <int Dim>
void insert_points(SimplexLattice<Dim>& lattice, const Execution& execution) {
  parallel_for(execution, static_cast<std::int64_t>(lattice.leaves.size()), kGrain, [&](std::int64_t i) {
    const std::int32_t side = lattice.sides[lattice.leaves[i].level];
    const Coord<Dim> centre = centre_of(lattice.leaves[i], side);
    if (side == 1) {
      lattice.points.insert_finest(lattice.leaves[i].corner);
    } else {
      lattice.points.insert(centre);
      for (int c = 0; c < 1 << Dim; ++c) lattice.points.insert(corner_of(centre, side, c));
    }
    if constexpr (Dim == 3) {
      for (int d = 0; d < Dim; ++d) {
        if (centre[d] == side) lattice.points.insert(shifted(centre, d, -side));
        if (centre[d] + side == lattice.extent[d]) lattice.points.insert(shifted(centre, d, side));
      }
    }
  });
}

/// Log2 of the side of the smallest leaf at each vertex: 0 beside the centre of a finest cell, else what the larger
/// leaves there say.
template <int Dim>
void find_spacing(SimplexLattice<Dim>& lattice, const Execution& execution) {
  lattice.spacing.resize(lattice.vertices.size());
  lattice.points.for_corners_without_finest(
      execution, [&](VertexId v) { lattice.spacing[v] = std::numeric_limits<std::uint8_t>::max(); });
  parallel_for(execution, static_cast<std::int64_t>(lattice.leaves.size()), kGrain, [&](std::int64_t i) {
    const std::int32_t side = lattice.sides[lattice.leaves[i].level];
    if (side == 1) return;
    const auto log2 = static_cast<std::uint8_t>(std::countr_zero(static_cast<std::uint32_t>(side)));
    const auto lower = [&](const Coord<Dim>& at) {
      const std::atomic_ref<std::uint8_t> spacing(lattice.spacing[lattice.points.even_id(at)]);
      std::uint8_t now = spacing.load(std::memory_order_relaxed);
      while (now > log2 && !spacing.compare_exchange_weak(now, log2, std::memory_order_relaxed)) {
      }
    };
    const Coord<Dim> centre = centre_of(lattice.leaves[i], side);
    lower(centre);
    for (int c = 0; c < 1 << Dim; ++c) lower(corner_of(centre, side, c));
    if constexpr (Dim == 3) {
      for (int d = 0; d < Dim; ++d) {
        if (centre[d] == side) lower(shifted(centre, d, -side));
        if (centre[d] + side == lattice.extent[d]) lower(shifted(centre, d, side));
      }
    }
  });
}

}  // namespace

template <int Dim>
SimplexLattice<Dim> tessellate_body_centred(Spacetree<Dim> tree, Execution& execution) {
  SimplexLattice<Dim> lattice;
  for (int l = 0; l <= tree.pattern.finest_level(); ++l) lattice.sides.push_back(tree.pattern.cell_extent(l)[0]);
  for (int d = 0; d < Dim; ++d) {
    lattice.unit[d] = tree.lattice.unit[d] / 2;
    lattice.extent[d] = tree.lattice.extent[d] * 2;
  }
  lattice.points = BodyCentredPoints<Dim>(tree.lattice.extent);
  lattice.leaves = std::move(tree.leaves);
  tree = {};
  insert_points(lattice, execution);
  const std::int64_t n = lattice.points.number(execution);
  if (n >= static_cast<std::int64_t>(std::numeric_limits<VertexId>::max()))
    throw Error(ErrorKind::limits, "--min-size: the lattice needs 2^32 vertices or more; choose larger cells");
  lattice.vertices = lattice.points.coordinates(n, execution);
  find_spacing(lattice, execution);
  return lattice;
}

#define TREEMARCH_INSTANTIATE(DIM)     \
  template struct LeafStar<DIM>;       \
  template struct SimplexLattice<DIM>; \
  template SimplexLattice<DIM> tessellate_body_centred(Spacetree<DIM>, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
