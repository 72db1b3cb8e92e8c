#include "treemarch/tessellate/body_centred.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 2048;  // leaves a block of the parallel loops

constexpr int power(int base, int exponent) { return exponent == 0 ? 1 : base * power(base, exponent - 1); }

/// Corners of a leaf are numbered by bits: bit d is set at the upper end along axis d. Directions to neighbours are
/// numbered in base three: digit d is 0 below, 1 beside, 2 above along axis d.
template <int Dim>
class Builder {
 public:
  static constexpr int kCorners = 1 << Dim;
  static constexpr int kDirections = power(3, Dim);
  using Simplex = std::array<VertexId, Dim + 1>;

  Builder(const Spacetree<Dim>& tree, const std::vector<std::uint8_t>& skip, Execution& execution)
      : tree_(tree), skip_(skip), execution_(execution) {}

  SimplexLattice<Dim> build() {
    find_owners();
    number_vertices();
    emit_simplices();
    return std::move(out_);
  }

 private:
  /// The leaf in whose run of vertices a lattice point is numbered: the first of those that have it as a corner.
  struct Owner {
    LeafId leaf = kNoLeaf;
    int corner = 0;
    std::int32_t smallest = std::numeric_limits<std::int32_t>::max();  // side of the smallest leaf around the point

    void offer(const Builder& builder, LeafId id, const Coord<Dim>& point);
  };
  /// The leaves around a leaf: of several smaller ones in one direction, one of them.
  using Neighbours = std::array<LeafId, kDirections>;

  [[nodiscard]] std::int64_t leaf_count() const { return static_cast<std::int64_t>(tree_.leaves.size()); }
  [[nodiscard]] bool skipped(LeafId leaf) const { return !skip_.empty() && skip_[leaf]; }
  [[nodiscard]] std::int32_t side(LeafId leaf) const { return tree_.extent_of(tree_.leaves[leaf])[0]; }
  [[nodiscard]] Coord<Dim> corner_point(LeafId leaf, int corner) const;
  [[nodiscard]] Neighbours neighbours_of(LeafId leaf) const;
  [[nodiscard]] Owner owner_of(const Coord<Dim>& point) const;
  [[nodiscard]] Owner owner_of(LeafId leaf, int corner, const Neighbours& around) const;

  void find_owners();
  void number_vertices();
  void emit_simplices();

  template <class Emit>
  void simplices_of(LeafId leaf, Emit&& emit) const;
  template <class Emit>
  void face_between_levels(LeafId small, LeafId big, int axis, int up, Emit&& emit) const;
  template <class Emit>
  void for_rim(LeafId leaf, int axis, int up, const Neighbours& around, Emit&& emit) const;

  const Spacetree<Dim>& tree_;
  const std::vector<std::uint8_t>& skip_;
  Execution& execution_;
  // Each leaf has a run of vertices: its centre, the corners that it owns, and (3D) the centres of its faces on the
  // hull.
  std::vector<VertexId> centre_;                             // first of the run
  std::vector<std::array<VertexId, kCorners>> corners_;      // of every leaf, owned or not; at first packed owners
  std::vector<std::array<std::uint8_t, kCorners>> spacing_;  // at every corner
  std::vector<std::uint8_t> owned_;                          // a bit a corner
  std::vector<std::uint8_t> hull_faces_;                     // a bit a face, 2 * axis + up
  SimplexLattice<Dim> out_;
};

template <int Dim>
Coord<Dim> Builder<Dim>::corner_point(LeafId leaf, int corner) const {
  Coord<Dim> p = tree_.leaves[leaf].corner;
  const std::int32_t s = side(leaf);
  for (int d = 0; d < Dim; ++d)
    if (corner >> d & 1) p[d] += s;
  return p;
}

template <int Dim>
typename Builder<Dim>::Neighbours Builder<Dim>::neighbours_of(LeafId leaf) const {
  const Coord<Dim>& lower = tree_.leaves[leaf].corner;
  const std::int32_t s = side(leaf);
  Neighbours around;
  for (int direction = 0; direction < kDirections; ++direction) {
    if (direction == kDirections / 2) {
      around[direction] = leaf;
      continue;
    }
    Coord<Dim> cell = lower;
    for (int d = 0, digits = direction; d < Dim; ++d, digits /= 3)
      cell[d] += digits % 3 == 0 ? -1 : digits % 3 == 2 ? s : 0;
    around[direction] = tree_.leaf_at(cell);
  }
  return around;
}

template <int Dim>
void Builder<Dim>::Owner::offer(const Builder& builder, LeafId id, const Coord<Dim>& point) {
  if (id == kNoLeaf) return;
  const Coord<Dim>& lower = builder.tree_.leaves[id].corner;
  const std::int32_t s = builder.side(id);
  smallest = std::min(smallest, s);
  int which = 0;
  bool is_corner = true;
  for (int d = 0; d < Dim; ++d) {
    which |= (point[d] == lower[d] + s) << d;
    is_corner &= point[d] == lower[d] || point[d] == lower[d] + s;
  }
  if (is_corner && (leaf == kNoLeaf || id < leaf)) leaf = id, corner = which;
}

template <int Dim>
typename Builder<Dim>::Owner Builder<Dim>::owner_of(const Coord<Dim>& point) const {
  Owner owner;
  for (int octant = 0; octant < kCorners; ++octant) {
    Coord<Dim> cell = point;
    for (int d = 0; d < Dim; ++d) cell[d] -= !(octant >> d & 1);
    owner.offer(*this, tree_.leaf_at(cell), point);
  }
  return owner;
}

/// The same for a corner of a leaf. Where a neighbour is not smaller, it is the leaf there at every place.
template <int Dim>
typename Builder<Dim>::Owner Builder<Dim>::owner_of(LeafId leaf, int corner, const Neighbours& around) const {
  const Coord<Dim> point = corner_point(leaf, corner);
  const std::int32_t s = side(leaf);
  Owner owner;
  for (int outward = 0; outward < kCorners; ++outward) {  // bit d: beyond the corner along axis d
    int direction = 0;
    for (int d = Dim; d-- > 0;) direction = 3 * direction + (outward >> d & 1 ? (corner >> d & 1 ? 2 : 0) : 1);
    LeafId id = around[direction];
    if (id != kNoLeaf && side(id) < s) {
      Coord<Dim> cell = point;
      for (int d = 0; d < Dim; ++d) cell[d] -= (corner >> d & 1) != (outward >> d & 1);
      id = tree_.leaf_at(cell);
    }
    owner.offer(*this, id, point);
  }
  return owner;
}

std::uint8_t log2_of(std::int32_t side) {
  return static_cast<std::uint8_t>(std::countr_zero(static_cast<std::uint32_t>(side)));
}

template <int Dim>
void Builder<Dim>::find_owners() {
  const std::int64_t n = leaf_count();
  if (n >= std::int64_t{1} << (32 - Dim))
    throw Error(ErrorKind::limits, "--min-size: the lattice needs 2^32 vertices or more; choose larger cells");
  corners_.resize(n);
  spacing_.resize(n);
  owned_.assign(n, 0);
  hull_faces_.assign(n, 0);
  parallel_for(execution_, n, kBlock, [&](std::int64_t i) {
    const LeafId leaf = static_cast<LeafId>(i);
    const Neighbours around = neighbours_of(leaf);
    for (int c = 0; c < kCorners; ++c) {
      const Owner owner = owner_of(leaf, c, around);
      corners_[i][c] = static_cast<VertexId>(owner.leaf) * kCorners + static_cast<VertexId>(owner.corner);
      spacing_[i][c] = log2_of(owner.smallest);
      if (owner.leaf == leaf) owned_[i] |= static_cast<std::uint8_t>(1U << c);
    }
    if constexpr (Dim == 3) {
      for (int d = 0, step = 1; d < Dim; ++d, step *= 3) {
        const bool low = around[kDirections / 2 - step] == kNoLeaf, high = around[kDirections / 2 + step] == kNoLeaf;
        hull_faces_[i] |= static_cast<std::uint8_t>((low | high << 1) << (2 * d));
      }
    }
  });
}

template <int Dim>
void Builder<Dim>::number_vertices() {
  const std::int64_t n = leaf_count();
  centre_.resize(n);
  std::int64_t next = 0;
  for (std::int64_t i = 0; i < n; ++i) {
    centre_[i] = static_cast<VertexId>(next);
    next += 1 + std::popcount(owned_[i]) + std::popcount(hull_faces_[i]);
  }
  if (next >= static_cast<std::int64_t>(std::numeric_limits<VertexId>::max()))
    throw Error(ErrorKind::limits, "--min-size: the lattice needs 2^32 vertices or more; choose larger cells");
  out_.vertices.resize(next);
  out_.spacing.resize(next);
  for (int d = 0; d < Dim; ++d) {
    out_.unit[d] = tree_.lattice.unit[d] / 2;
    out_.extent[d] = tree_.lattice.extent[d] * 2;
  }
  parallel_for(execution_, n, kBlock, [&](std::int64_t i) {
    const LeafId leaf = static_cast<LeafId>(i);
    const std::int32_t s = side(leaf);
    Coord<Dim> centre{};
    for (int d = 0; d < Dim; ++d) centre[d] = 2 * tree_.leaves[i].corner[d] + s;
    VertexId v = centre_[i];
    const auto place = [&](const Coord<Dim>& at, std::uint8_t spacing) {
      out_.vertices[v] = at;
      out_.spacing[v++] = spacing;
    };
    place(centre, log2_of(s));
    for (int c = 0; c < kCorners; ++c) {
      if (!(owned_[i] >> c & 1)) continue;
      Coord<Dim> p = centre;
      for (int d = 0; d < Dim; ++d) p[d] += c >> d & 1 ? s : -s;
      place(p, spacing_[i][c]);
    }
    for (int face = 0; face < 2 * Dim; ++face) {
      if (!(hull_faces_[i] >> face & 1)) continue;
      Coord<Dim> p = centre;
      p[face / 2] += face % 2 ? s : -s;
      place(p, log2_of(s));
    }
    for (VertexId& packed : corners_[i]) {
      const std::int64_t owner = packed / kCorners;
      const unsigned before = owned_[owner] & ((1U << (packed % kCorners)) - 1);
      packed = centre_[owner] + 1 + static_cast<VertexId>(std::popcount(before));
    }
  });
}

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

/// Calls emit(a, b) for the segments of the rim of a face (2D: of the face). A hanging vertex halves an edge.
template <int Dim>
template <class Emit>
void Builder<Dim>::for_rim(LeafId leaf, int axis, int up, const Neighbours& around, Emit&& emit) const {
  const auto ring = face_ring<Dim>(axis, up);
  const std::int32_t s = side(leaf);
  // Whether a leaf around the edge between two corners is smaller: the edge then has a vertex in its middle.
  const auto halved = [&](int from, int to) {
    for (int outward = 1; outward < kCorners; ++outward) {
      int direction = 0;
      bool beside = false;
      for (int d = Dim; d-- > 0;) {
        const bool along = (from ^ to) >> d & 1, out = outward >> d & 1;
        beside |= along && out;
        direction = 3 * direction + (out ? (from >> d & 1 ? 2 : 0) : 1);
      }
      if (!beside && around[direction] != kNoLeaf && side(around[direction]) < s) return true;
    }
    return false;
  };
  constexpr int kEdges = Dim == 2 ? 1 : 4;
  for (int k = 0; k < kEdges; ++k) {
    const int from = ring[k], to = ring[(k + 1) % ring.size()];
    const VertexId a = corners_[leaf][from], b = corners_[leaf][to];
    Owner hanging;
    if (s > 1 && halved(from, to)) {
      Coord<Dim> middle = corner_point(leaf, from);
      const Coord<Dim> end = corner_point(leaf, to);
      for (int d = 0; d < Dim; ++d) middle[d] = (middle[d] + end[d]) / 2;
      hanging = owner_of(middle);
    }
    if (hanging.leaf == kNoLeaf) {
      emit(a, b);
    } else {
      const VertexId m = corners_[hanging.leaf][hanging.corner];
      emit(a, m);
      emit(m, b);
    }
  }
}

/// The small face is split by the diagonal through the centre of the big one, and both triangles are joined to both
/// centres: the other diagonal would give 35 to 125 degrees.
template <int Dim>
template <class Emit>
void Builder<Dim>::face_between_levels(LeafId small, LeafId big, int axis, int up, Emit&& emit) const {
  const auto ring = face_ring<3>(axis, up);
  // The centre of the big face is that corner of the small one that is not on the big one's rim.
  int through = up << axis;
  for (int d = 0; d < Dim; ++d)
    if (d != axis && tree_.leaves[small].corner[d] == tree_.leaves[big].corner[d]) through |= 1 << d;
  const int k = static_cast<int>(std::find(ring.begin(), ring.end(), through) - ring.begin());
  const VertexId below = up ? centre_[small] : centre_[big], above = up ? centre_[big] : centre_[small];
  for (const int second : {1, 2}) {
    const VertexId a = corners_[small][through], b = corners_[small][ring[(k + second) % 4]],
                   c = corners_[small][ring[(k + second + 1) % 4]];
    emit(Simplex{below, a, b, c});
    emit(Simplex{above, a, c, b});
  }
}

template <int Dim>
template <class Emit>
void Builder<Dim>::simplices_of(LeafId leaf, Emit&& emit) const {
  const VertexId centre = centre_[leaf];
  Neighbours around{};
  if (side(leaf) > 1) around = neighbours_of(leaf);  // leaves of the smallest side have no halved edges
  if constexpr (Dim == 2) {
    if (skipped(leaf)) return;
    for (int face = 0; face < 4; ++face) {
      const int axis = face / 2, up = face % 2;
      for_rim(leaf, axis, up, around, [&](VertexId a, VertexId b) {
        if ((axis == 0) == (up == 1))
          emit(Simplex{centre, a, b});
        else
          emit(Simplex{centre, b, a});
      });
    }
  } else {
    VertexId hull_centre = centre + 1 + static_cast<VertexId>(std::popcount(owned_[leaf]));
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, up = face % 2;
      Coord<Dim> beyond = tree_.leaves[leaf].corner;
      beyond[axis] += up ? side(leaf) : -1;
      const LeafId next = tree_.leaf_at(beyond);
      if (next == kNoLeaf) {
        const VertexId middle = hull_centre++;
        if (skipped(leaf)) continue;
        for_rim(leaf, axis, up, around, [&](VertexId a, VertexId b) {
          if (up)
            emit(Simplex{centre, a, b, middle});
          else
            emit(Simplex{centre, b, a, middle});
        });
      } else if (skipped(leaf) && skipped(next)) {
        continue;
      } else if (side(next) == side(leaf)) {
        if (!up) continue;  // the lower one of the two leaves does it
        for_rim(leaf, axis, up, around, [&](VertexId a, VertexId b) { emit(Simplex{centre, a, b, centre_[next]}); });
      } else if (side(next) > side(leaf)) {  // else the small leaf does it
        face_between_levels(leaf, next, axis, up, emit);
      }
    }
  }
}

template <int Dim>
void Builder<Dim>::emit_simplices() {
  const std::int64_t n = leaf_count(), blocks = block_count(n, kBlock);
  std::vector<std::int64_t> first(blocks);
  const auto for_block = [&](std::int64_t block, auto&& emit) {
    const std::int64_t end = std::min(n, (block + 1) * kBlock);
    for (std::int64_t i = block * kBlock; i < end; ++i) simplices_of(static_cast<LeafId>(i), emit);
  };
  parallel_for(execution_, blocks, 1, [&](std::int64_t block) {
    std::int64_t count = 0;
    for_block(block, [&](const Simplex&) { ++count; });
    first[block] = count;
  });
  out_.simplices.resize(exclusive_scan<std::int64_t>(first));
  parallel_for(execution_, blocks, 1, [&](std::int64_t block) {
    std::int64_t next = first[block];
    for_block(block, [&](const Simplex& simplex) { out_.simplices[next++] = simplex; });
  });
}

}  // namespace

template <int Dim>
SimplexLattice<Dim> tessellate_body_centred(const Spacetree<Dim>& tree, const std::vector<std::uint8_t>& skip,
                                            Execution& execution) {
  return Builder<Dim>(tree, skip, execution).build();
}

template SimplexLattice<2> tessellate_body_centred(const Spacetree<2>&, const std::vector<std::uint8_t>&, Execution&);
template SimplexLattice<3> tessellate_body_centred(const Spacetree<3>&, const std::vector<std::uint8_t>&, Execution&);

}  // namespace treemarch
