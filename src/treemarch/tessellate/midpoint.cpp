#include "treemarch/tessellate/midpoint.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/tessellate/lattice_points.h"
#include "treemarch/tessellate/rim_triangles.h"

namespace treemarch {
namespace {

constexpr std::int64_t kLeavesPerBlock = 1024;

using AxisMask = unsigned;

template <int Dim>
inline constexpr AxisMask kAllAxes = (1U << Dim) - 1;

/// A face of a leaf, or a part of one: a box that is flat along the axes that are not in `axes`. Its sides are those of
/// a cell of `level`.
template <int Dim>
struct Face {
  Coord<Dim> corner{};
  AxisMask axes = 0;
  int level = 0;
};

/// What all threads know: the tree, the vertices so far, and tables of the refinement pattern.
template <int Dim>
class Complex {
 public:
  Complex(const Spacetree<Dim>& tree, LatticePoints<Dim>& points) : tree_(tree), points_(points) {
    const int levels = tree.pattern.finest_level() + 1;
    for (int l = 0; l < levels; ++l) extent_.push_back(tree.pattern.cell_extent(l));
    const auto same = [&](int a, int b, AxisMask axes) {
      for (int d = 0; d < Dim; ++d)
        if ((axes >> d & 1U) != 0 && extent_[a][d] != extent_[b][d]) return false;
      return true;
    };
    for (int l = 0; l < levels; ++l) {
      next_.emplace_back();
      for (AxisMask axes = 0; axes <= kAllAxes<Dim>; ++axes) {
        int next = l;
        while (next < levels && same(l, next, axes)) ++next;
        next_.back()[axes] = next;
      }
    }
  }

  [[nodiscard]] const Vec<Dim>& unit() const { return tree_.lattice.unit; }
  [[nodiscard]] const Coord<Dim>& extent(int level) const { return extent_[level]; }
  /// The first level whose cells are smaller than those of `level` along one of the axes; beyond the finest if none is.
  [[nodiscard]] int next_level(int level, AxisMask axes) const { return next_[level][axes]; }
  [[nodiscard]] LatticePoints<Dim>& points() { return points_; }
  [[nodiscard]] LeafId leaf_at(const Coord<Dim>& cell) const { return tree_.leaf_at(cell); }

  /// Whether a leaf that touches the interior of the face is smaller than it, within the face. The grids of the levels
  /// are nested, hence the first refinement along the face divides all of it, and its lower corner tells.
  [[nodiscard]] bool is_divided(const Face<Dim>& face) const {
    const int next = next_level(face.level, face.axes);
    if (next > tree_.pattern.finest_level()) return false;
    if ((face.axes & (face.axes - 1)) == 0) {  // an edge: then there is a vertex on it
      Coord<Dim> half{};
      for (int d = 0; d < Dim; ++d) half[d] = 2 * (face.corner[d] + ((face.axes >> d & 1U) != 0 ? extent(next)[d] : 0));
      return points_.contains(half);
    }
    const AxisMask normals = kAllAxes<Dim> & ~face.axes;
    AxisMask side = normals;
    while (true) {  // all subsets of the normals: the cells around the corner
      Coord<Dim> cell = face.corner;
      for (int d = 0; d < Dim; ++d) cell[d] -= static_cast<std::int32_t>(side >> d & 1U);
      const LeafId leaf = tree_.leaf_at(cell);
      if (leaf != kNoLeaf && tree_.leaves[leaf].level >= next) return true;
      if (side == 0) return false;
      side = (side - 1) & normals;
    }
  }

  /// No hanging node on any of its edges, and so on none of its faces either.
  [[nodiscard]] bool is_regular(const Face<Dim>& face) const {
    for (int d = 0; d < Dim; ++d) {
      const AxisMask axis = 1U << d;
      if ((face.axes & axis) == 0) continue;
      const AxisMask across = face.axes & ~axis;
      AxisMask side = across;
      while (true) {
        Face<Dim> edge{face.corner, axis, face.level};
        for (int n = 0; n < Dim; ++n)
          if ((side >> n & 1U) != 0) edge.corner[n] += extent(face.level)[n];
        if (is_divided(edge)) return false;
        if (side == 0) break;
        side = (side - 1) & across;
      }
    }
    return true;
  }

  /// The parity of the lower corner of a rectangle in units of its own sides; along its normals, where two cells that
  /// share it may differ, in those of the thinnest cell that has such a face. Source: design, section 4.
  [[nodiscard]] unsigned parity(const Face<Dim>& rectangle) const {
    const Coord<Dim>& side = extent(next_level(rectangle.level, rectangle.axes) - 1);
    std::int32_t sum = 0;
    for (int d = 0; d < Dim; ++d) sum += rectangle.corner[d] / side[d];
    return static_cast<unsigned>(sum) & 1U;
  }

 private:
  const Spacetree<Dim>& tree_;
  LatticePoints<Dim>& points_;
  std::vector<Coord<Dim>> extent_;
  std::vector<std::array<int, kAllAxes<Dim> + 1>> next_;
};

/// Divides one leaf after the other into cells, given to a visitor as corners in half units: simplices, pyramids (3D)
/// and boxes, told apart by their number of corners.
template <int Dim, class Visit>
class Divider {
 public:
  Divider(Complex<Dim>& complex, const MidpointOptions& options, Visit visit)
      : complex_(complex), options_(options), visit_(std::move(visit)) {}

  void divide(LeafId id, const Leaf<Dim>& leaf) {
    const Face<Dim> all{leaf.corner, kAllAxes<Dim>, leaf.level};
    const LeafShape shape = shape_of(id);
    if (shape == LeafShape::box) return box(all);
    templates_ = options_.templates && shape == LeafShape::simplices;
    whole<Dim>(all);
  }

 private:
  /// A face that may consist of smaller ones.
  template <int K>
  void any(const Face<Dim>& face) {
    if (!complex_.is_divided(face)) {
      whole<K>(face);
      return;
    }
    const int next = complex_.next_level(face.level, face.axes);
    const Coord<Dim>& big = complex_.extent(face.level);
    const Coord<Dim>& small = complex_.extent(next);
    Face<Dim> part{face.corner, face.axes, next};
    while (true) {
      any<K>(part);
      int d = 0;
      for (; d < Dim; ++d) {
        if ((face.axes >> d & 1U) == 0) continue;
        part.corner[d] += small[d];
        if (part.corner[d] < face.corner[d] + big[d]) break;
        part.corner[d] = face.corner[d];
      }
      if (d == Dim) return;
    }
  }

  /// A face of dimension K that no smaller leaf divides; its own boundary may have hanging nodes.
  template <int K>
  void whole(const Face<Dim>& face) {
    if constexpr (K == 1) {
      corner(0, face, 0);
      corner(1, face, face.axes);
      visit_(simplex_);
    } else {
      // The facets of a leaf must be divided in the same way whatever `templates` says about the leaf itself.
      if ((K < Dim || templates_) && complex_.is_regular(face)) {
        if constexpr (K == 2) {
          if constexpr (Dim == 3)
            if (stays_whole(face)) return pyramid(face);
          return rectangle(face);
        }
        if (unsigned odd = 0; fits_template<K>(face, odd)) {
          if constexpr (K == 3) return cuboid(face, odd);
          if constexpr (K == 4) return tesseract(face, odd);
        }
      }
      if constexpr (K == 2 && Dim > 2)
        if (options_.facets == FacetRule::extended && rim_rule(face)) return;
      midpoint_rule<K>(face);
    }
  }

  template <int K>
  void midpoint_rule(const Face<Dim>& face) {
    const Coord<Dim>& side = complex_.extent(face.level);
    Coord<Dim>& centre = simplex_[K];
    for (int d = 0; d < Dim; ++d) centre[d] = 2 * face.corner[d] + ((face.axes >> d & 1U) != 0 ? side[d] : 0);
    complex_.points().insert(centre);
    for (int d = 0; d < Dim; ++d) {
      if ((face.axes >> d & 1U) == 0) continue;
      Face<Dim> facet{face.corner, face.axes & ~(1U << d), face.level};
      any<K - 1>(facet);
      facet.corner[d] += side[d];
      any<K - 1>(facet);
    }
  }

  /// Divides a rectangle by triangles between the vertices of its rim. Returns false, and does nothing, where there are
  /// too many of them.
  bool rim_rule(const Face<Dim>& face) {
    constexpr std::size_t kMost = 128;  // the search is cubic
    find_rim(face);
    if (rim_.size() > kMost) return false;
    const AxisMask first = face.axes & (0U - face.axes);
    const int x = std::countr_zero(first), y = std::countr_zero(face.axes ^ first);
    std::vector<Vec<2>> points;
    for (const Coord<Dim>& v : rim_)
      points.push_back({(v[x] - rim_[0][x]) * complex_.unit()[x], (v[y] - rim_[0][y]) * complex_.unit()[y]});
    const RimTriangles rim = triangulate_rim(points);
    if (rim.largest_cosine > 1) return false;
    for (const auto& triangle : rim.triangles) {
      for (int i = 0; i < 3; ++i) simplex_[i] = rim_[triangle[i]];
      visit_(simplex_);
    }
    return true;
  }

  /// The vertices around a rectangle, from its lower corner along its first axis.
  void find_rim(const Face<Dim>& face) {
    const AxisMask x = face.axes & (0U - face.axes), y = face.axes ^ x;
    rim_.clear();
    const auto edge = [&](AxisMask along, AxisMask beside, bool backwards) {
      Face<Dim> side{face.corner, along, face.level};
      for (int d = 0; d < Dim; ++d)
        if ((beside >> d & 1U) != 0) side.corner[d] += complex_.extent(face.level)[d];
      const std::size_t begin = rim_.size();
      add_segments(side, backwards);
      if (backwards) std::reverse(rim_.begin() + static_cast<std::ptrdiff_t>(begin), rim_.end());
    };
    edge(x, 0, false);
    edge(y, x, false);
    edge(x, y, true);
    edge(y, 0, true);
  }

  /// The starts of the segments of an edge, or their ends.
  void add_segments(const Face<Dim>& edge, bool ends) {
    if (!complex_.is_divided(edge)) {
      rim_.push_back(at(edge, ends ? edge.axes : 0));
      return;
    }
    const int axis = std::countr_zero(edge.axes);
    const int next = complex_.next_level(edge.level, edge.axes);
    Face<Dim> part{edge.corner, edge.axes, next};
    const std::int32_t end = edge.corner[axis] + complex_.extent(edge.level)[axis];
    for (; part.corner[axis] < end; part.corner[axis] += complex_.extent(next)[axis]) add_segments(part, ends);
  }

  [[nodiscard]] LeafShape shape_of(LeafId id) const {
    return options_.shapes.empty() ? LeafShape::simplices : options_.shapes[id];
  }

  /// Whether neither of the leaves at a facet is to become simplices.
  [[nodiscard]] bool stays_whole(const Face<Dim>& facet) const {
    if (options_.shapes.empty()) return false;
    for (const unsigned side : {0U, 1U}) {
      Coord<Dim> cell = facet.corner;
      for (int d = 0; d < Dim; ++d)
        if ((facet.axes >> d & 1U) == 0) cell[d] -= static_cast<std::int32_t>(side);
      const LeafId id = complex_.leaf_at(cell);
      if (id != kNoLeaf && shape_of(id) == LeafShape::simplices) return false;
    }
    return true;
  }

  /// Joins a facet to the centre of the leaf.
  void pyramid(const Face<Dim>& facet) {
    int normal = 0;
    while ((facet.axes >> normal & 1U) != 0) ++normal;
    std::array<Coord<Dim>, 5> cell{};
    ring(facet, cell.data());
    cell[4] = simplex_[3];
    // The ring is counter-clockwise around the cross product of its axes, which is against the second axis.
    const bool above = cell[4][normal] > cell[0][normal];
    if (above == (normal == 1)) std::swap(cell[1], cell[3]);
    visit_(cell);
  }

  /// The leaf as one cell.
  void box(const Face<Dim>& leaf) {
    if constexpr (Dim == 2 || Dim == 3) {
      std::array<Coord<Dim>, (1 << Dim)> cell{};
      Face<Dim> bottom{leaf.corner, 3, leaf.level};
      ring(bottom, cell.data());
      if constexpr (Dim == 3) {
        bottom.corner[2] += complex_.extent(leaf.level)[2];
        ring(bottom, cell.data() + 4);
      }
      visit_(cell);
    }
  }

  /// The four corners of a rectangle in a round.
  void ring(const Face<Dim>& rectangle, Coord<Dim>* out) const {
    const AxisMask first = rectangle.axes & (0U - rectangle.axes);
    for (const AxisMask far : {0U, first, rectangle.axes, rectangle.axes ^ first}) *out++ = at(rectangle, far);
  }

  void rectangle(const Face<Dim>& face) {
    const AxisMask first = face.axes & (0U - face.axes);
    const AxisMask second = face.axes & ~first;
    const bool odd = complex_.parity(face) != 0;
    // The diagonal joins corners 0 and 1; corner 2 is on either side of it.
    corner(0, face, odd ? first : 0);
    corner(1, face, odd ? second : face.axes);
    corner(2, face, odd ? 0 : first);
    visit_(simplex_);
    corner(2, face, odd ? face.axes : second);
    visit_(simplex_);
  }

  /// Whether the diagonals of all rectangles of a face join corners of one parity, and if so which.
  template <int K>
  bool fits_template(const Face<Dim>& face, unsigned& odd) const {
    if constexpr (K == 2) {
      odd = complex_.parity(face);
      return true;
    } else {
      bool first = true;
      for (int d = 0; d < Dim; ++d) {
        if ((face.axes >> d & 1U) == 0) continue;
        Face<Dim> facet{face.corner, face.axes & ~(1U << d), face.level};
        for (const unsigned far : {0U, 1U}) {
          if (far != 0) facet.corner[d] += complex_.extent(face.level)[d];
          unsigned p = 0;
          if (!fits_template<K - 1>(facet, p)) return false;
          if (first) odd = p ^ far;
          first = false;
          if ((p ^ far) != odd) return false;
        }
      }
      return true;
    }
  }

  void cuboid(const Face<Dim>& face, unsigned odd) {
    const AxisMask x = face.axes & (0U - face.axes);
    const AxisMask y = (face.axes ^ x) & (0U - (face.axes ^ x));
    const AxisMask z = face.axes ^ x ^ y;
    // The inner tetrahedron joins the corners o, o^x^y, o^x^z, o^y^z; each of the other four corners is cut off.
    const AxisMask o = odd != 0 ? x : 0;
    const std::array<AxisMask, 4> inner{o, o ^ x ^ y, o ^ x ^ z, o ^ y ^ z};
    for (int i = 0; i < 4; ++i) corner(i, face, inner[i]);
    visit_(simplex_);
    for (int i = 0; i < 4; ++i) {
      corner(i, face, inner[i] ^ face.axes);
      visit_(simplex_);
      corner(i, face, inner[i]);
    }
  }

  /// Cuts off the eight corners of the other parity. What is left is a cross-polytope, whose facets are the inner
  /// tetrahedra of the eight cuboids and the bases of the corners; it falls into the eight simplices around one of its
  /// diagonals.
  void tesseract(const Face<Dim>& face, unsigned odd) {
    const AxisMask o = odd != 0 ? 1U : 0U;
    for (AxisMask even = 0; even < 16; ++even) {
      if (std::popcount(even) % 2 != 0) continue;
      const AxisMask off = even ^ o ^ 1U;
      corner(0, face, off);
      for (int d = 0; d < 4; ++d) corner(d + 1, face, off ^ 1U << d);
      visit_(simplex_);
    }
    // The corners of the cross-polytope come in pairs of opposite ones: o and o^15, and three more.
    constexpr std::array<AxisMask, 3> kPairs{0b0011, 0b0101, 0b1001};
    corner(0, face, o);
    corner(1, face, o ^ 0b1111U);
    for (AxisMask side = 0; side < 8; ++side) {
      for (int i = 0; i < 3; ++i) corner(i + 2, face, o ^ kPairs[i] ^ ((side >> i & 1U) != 0 ? 0b1111U : 0U));
      visit_(simplex_);
    }
  }

  /// Vertex i of the simplex becomes the corner of the face on the far side along the axes of `far`.
  void corner(int i, const Face<Dim>& face, AxisMask far) { simplex_[i] = at(face, far); }
  [[nodiscard]] Coord<Dim> at(const Face<Dim>& face, AxisMask far) const {
    const Coord<Dim>& side = complex_.extent(face.level);
    Coord<Dim> half{};
    for (int d = 0; d < Dim; ++d) half[d] = 2 * (face.corner[d] + ((far >> d & 1U) != 0 ? side[d] : 0));
    return half;
  }

  Complex<Dim>& complex_;
  const MidpointOptions& options_;
  bool templates_ = true;  // for the leaf at hand
  Visit visit_;
  std::vector<Coord<Dim>> rim_;  ///< of the rectangle at hand, in half units
  std::array<Coord<Dim>, Dim + 1> simplex_{};
};

template <int N>
std::int64_t determinant(const std::array<std::array<std::int64_t, N>, N>& m) {
  if constexpr (N == 1) {
    return m[0][0];
  } else {
    std::int64_t sum = 0;
    for (int c = 0; c < N; ++c) {
      std::array<std::array<std::int64_t, N - 1>, N - 1> minor{};
      for (int i = 1; i < N; ++i)
        for (int j = 0, k = 0; j < N; ++j)
          if (j != c) minor[i - 1][k++] = m[i][j];
      sum += (c % 2 == 0 ? 1 : -1) * m[0][c] * determinant<N - 1>(minor);
    }
    return sum;
  }
}

template <int Dim>
bool is_positive(const std::array<Coord<Dim>, Dim + 1>& simplex) {
  std::array<std::array<std::int64_t, Dim>, Dim> m{};
  for (int i = 0; i < Dim; ++i)
    for (int d = 0; d < Dim; ++d) m[i][d] = simplex[i + 1][d] - simplex[0][d];
  return determinant<Dim>(m) > 0;
}

/// The cells of a hybrid mesh: simplices, pyramids, boxes.
constexpr std::size_t kKinds = 3;
using CellCounts = std::array<std::int64_t, kKinds>;
template <int Dim>
constexpr std::array<CellType, kKinds> kCellTypes{kSimplex<Dim>, CellType::pyramid,
                                                  Dim == 2 ? CellType::quad : CellType::hexahedron};
template <int Dim, std::size_t corners>
constexpr std::size_t kind = corners == Dim + 1 ? 0
                             : corners == 5     ? 1
                                                : 2;

template <int Dim>
void insert_corners(const Spacetree<Dim>& tree, LatticePoints<Dim>& points, const Execution& execution) {
  parallel_for(execution, static_cast<std::int64_t>(tree.leaves.size()), kLeavesPerBlock, [&](std::int64_t i) {
    const Leaf<Dim>& leaf = tree.leaves[i];
    for (AxisMask far = 0; far <= kAllAxes<Dim>; ++far) {
      Coord<Dim> half{};
      for (int d = 0; d < Dim; ++d)
        half[d] = 2 * (leaf.corner[d] + ((far >> d & 1U) != 0 ? tree.extent_of(leaf)[d] : 0));
      points.insert(half);
    }
  });
}

}  // namespace

template <int Dim>
Mesh<Dim> tessellate_midpoint(const Spacetree<Dim>& tree, const MidpointOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "tessellate");
  const auto leaves = static_cast<std::int64_t>(tree.leaves.size());
  LatticePoints<Dim> points(tree.lattice);
  insert_corners(tree, points, execution);
  execution.progress(0.2);

  // Centres that the first pass inserts lie inside faces of two or more dimensions and so never on an edge, where
  // is_divided() looks: the order of the leaves does not matter.
  Complex<Dim> complex(tree, points);
  std::vector<CellCounts> first(static_cast<std::size_t>(block_count(leaves, kLeavesPerBlock)));
  const auto blocks = static_cast<std::int64_t>(first.size());
  const auto divide_block = [&](std::int64_t block, auto&& visit, auto&& after_leaf) {
    Divider divider(complex, options, visit);
    for (std::int64_t i = block * kLeavesPerBlock; i < std::min(leaves, (block + 1) * kLeavesPerBlock); ++i) {
      divider.divide(static_cast<LeafId>(i), tree.leaves[i]);
      after_leaf(tree.leaves[i]);
    }
  };
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    CellCounts count{};
    divide_block(
        b, [&]<std::size_t N>(const std::array<Coord<Dim>, N>&) { ++count[kind<Dim, N>]; }, [](const auto&) {});
    first[b] = count;
  });
  execution.progress(0.5);
  CellCounts cells{};
  for (CellCounts& c : first)
    for (std::size_t k = 0; k < c.size(); ++k) cells[k] += std::exchange(c[k], cells[k]);
  points.number(execution);

  Mesh<Dim> mesh;
  std::array<CellBlock, kKinds> out;
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k].type = kCellTypes<Dim>[k];
    out[k].vertices.resize(static_cast<std::size_t>(cells[k] * vertex_count(out[k].type)));
    out[k].materials.resize(static_cast<std::size_t>(cells[k]));
  }
  parallel_for(execution, blocks, 1, [&](std::int64_t b) {
    CellCounts next = first[b], done = first[b];
    const auto write = [&]<std::size_t N>(const std::array<Coord<Dim>, N>& cell) {
      VertexId* vertex = out[kind<Dim, N>].vertices.data() + next[kind<Dim, N>]++ * static_cast<std::int64_t>(N);
      for (std::size_t v = 0; v < N; ++v) vertex[v] = points.id(cell[v]);
      if constexpr (N == Dim + 1)
        if (!is_positive<Dim>(cell)) std::swap(vertex[Dim - 1], vertex[Dim]);
    };
    divide_block(b, write, [&](const Leaf<Dim>& leaf) {
      for (std::size_t k = 0; k < out.size(); ++k)
        std::fill(out[k].materials.begin() + done[k], out[k].materials.begin() + next[k], leaf.material);
      done = next;
    });
  });
  mesh.points = points.positions(tree.lattice, execution);
  for (std::size_t k = 0; k < out.size(); ++k)
    if (out[k].size() > 0) mesh.blocks.push_back(std::move(out[k]));
  return mesh;
}

template Mesh<1> tessellate_midpoint(const Spacetree<1>&, const MidpointOptions&, Execution&);
template Mesh<2> tessellate_midpoint(const Spacetree<2>&, const MidpointOptions&, Execution&);
template Mesh<3> tessellate_midpoint(const Spacetree<3>&, const MidpointOptions&, Execution&);
template Mesh<4> tessellate_midpoint(const Spacetree<4>&, const MidpointOptions&, Execution&);

}  // namespace treemarch
