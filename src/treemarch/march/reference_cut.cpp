#include "treemarch/march/reference_cut.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/stencil.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 4096;
constexpr double kLeastOfEdge = 0.01;
constexpr double kLeastBarycentric = 0.05;

template <int Dim>
MaterialId heaviest_label(const Field<Dim>& field, const Vec<Dim>& x) {
  std::array<LabelWeight, 1> best{};
  field.sample(x, best);
  const MaterialId own = field.voxel_label(x);
  return field.difference(x, own, best[0].material) == 0 ? own : best[0].material;
}

/// The barycentric coordinates at which N linear functions are equal, as N equations: sum 1, and each function equal to
/// the last. No solution gives the middle.
template <int N>
std::array<double, N> equal_point(const std::array<std::array<double, N>, N>& weight) {
  std::array<std::array<double, N + 1>, N> m{};
  m[0].fill(1);
  for (int r = 1; r < N; ++r)
    for (int c = 0; c < N; ++c) m[r][c] = weight[r - 1][c] - weight[N - 1][c];
  std::array<double, N> middle;
  middle.fill(1.0 / N);
  for (int c = 0; c < N; ++c) {
    int pivot = c;
    for (int r = c + 1; r < N; ++r)
      if (std::abs(m[r][c]) > std::abs(m[pivot][c])) pivot = r;
    if (std::abs(m[pivot][c]) < 1e-9) return middle;
    std::swap(m[pivot], m[c]);
    for (int r = 0; r < N; ++r) {
      if (r == c) continue;
      const double factor = m[r][c] / m[c][c];
      for (int k = c; k <= N; ++k) m[r][k] -= factor * m[c][k];
    }
  }
  std::array<double, N> x;
  double sum = 0;
  for (int c = 0; c < N; ++c) sum += x[c] = std::max(m[c][N] / m[c][c], kLeastBarycentric);
  for (double& b : x) b /= sum;
  return x;
}

template <int Dim>
class ReferenceCutter {
 public:
  using T = StencilTopology<Dim>;
  using Simplex = std::array<VertexId, Dim + 1>;
  using Edge = std::array<VertexId, 2>;
  using Triangle = std::array<VertexId, 3>;

  ReferenceCutter(const Mesh<Dim>& mesh, const Field<Dim>& field, ReferencePlaces places, Execution& execution)
      : mesh_(mesh), field_(field), places_(places), execution_(execution) {
    for (const CellBlock& block : mesh.blocks)
      if (block.type == kSimplex<Dim>) simplices_ = &block;
  }

  void run(Mesh<Dim>& out, ReferenceReport& report) {
    label_vertices();
    if (simplices_) find_cuts();
    place_points(out, report);
    if (simplices_) write(out);
  }

 private:
  /// A simplex with its corners in the order of their numbers.
  struct Sorted {
    Simplex corner;
    bool odd = false;      ///< whether that is an odd permutation
    unsigned cuts = 0;     ///< bit e: the ends of edge e differ
    unsigned pattern = 0;  ///< as in stencil_pattern()
  };

  [[nodiscard]] Sorted sorted(std::int64_t simplex) const;
  [[nodiscard]] static std::size_t choice_of(const Sorted& s, const Stencil<Dim>& all) {
    return std::popcount(s.cuts) == T::kEdges ? all.choices.size() - 1 : 0;
  }
  [[nodiscard]] bool has_inner(const Sorted& s) const { return Dim == 3 && std::popcount(s.cuts) == T::kEdges; }
  void label_vertices();
  void find_cuts();
  [[nodiscard]] Vec<Dim> cut_point(const Edge& edge) const;
  template <std::size_t N>
  [[nodiscard]] Vec<Dim> equal_place(const std::array<VertexId, N>& corners) const;
  void place_points(Mesh<Dim>& out, ReferenceReport& report);
  void write(Mesh<Dim>& out) const;
  void write_pieces(const Sorted& s, VertexId inner, CellBlock& block, std::int64_t at) const;

  const Mesh<Dim>& mesh_;
  const Field<Dim>& field_;
  ReferencePlaces places_;
  Execution& execution_;
  const CellBlock* simplices_ = nullptr;
  std::vector<MaterialId> label_;                   // of each vertex
  std::vector<Edge> edges_;                         // that are cut, ascending
  std::vector<Triangle> triangles_;                 // with three labels, ascending
  std::vector<Simplex> inner_;                      // sorted corners of simplices with an inner point, in their order
  std::vector<std::int64_t> pieces_, inner_first_;  // per block of simplices: the first of each
  std::int64_t piece_count_ = 0;
  VertexId first_cut_ = 0, first_triple_ = 0, first_inner_ = 0;
};

template <int Dim>
typename ReferenceCutter<Dim>::Sorted ReferenceCutter<Dim>::sorted(std::int64_t simplex) const {
  Sorted s;
  std::copy_n(simplices_->cell(simplex), Dim + 1, s.corner.begin());
  for (int i = 1; i <= Dim; ++i)
    for (int j = i; j > 0 && s.corner[j] < s.corner[j - 1]; --j) {
      std::swap(s.corner[j], s.corner[j - 1]);
      s.odd = !s.odd;
    }
  // The diagonal of a quadrilateral starts at its smallest corner, so it ends at the cut of the other one: that cut has
  // the smaller rank. Corners are ascending here, so the same ranks serve all simplices.
  std::array<std::uint8_t, T::kEdges> rank{};
  for (int e = 0; e < T::kEdges; ++e) {
    rank[e] = static_cast<std::uint8_t>(T::kEdges - 1 - e);
    if (label_[s.corner[T::kEdge[e][0]]] != label_[s.corner[T::kEdge[e][1]]]) s.cuts |= 1U << e;
  }
  s.pattern = stencil_pattern<Dim>(s.cuts, rank);
  return s;
}

template <int Dim>
void ReferenceCutter<Dim>::label_vertices() {
  label_.resize(mesh_.points.size());
  parallel_for(execution_, static_cast<std::int64_t>(label_.size()), 1024, [&](std::int64_t v) {
    label_[static_cast<std::size_t>(v)] = heaviest_label(field_, mesh_.points[static_cast<std::size_t>(v)]);
  });
}

/// Finds what gets a point, and counts the pieces.
template <int Dim>
void ReferenceCutter<Dim>::find_cuts() {
  struct Found {
    std::vector<Edge> edges;
    std::vector<Triangle> triangles;
    std::vector<Simplex> inner;
    std::int64_t pieces = 0;
  };
  std::vector<Found> found(static_cast<std::size_t>(block_count(simplices_->size(), kBlock)));
  parallel_for(execution_, static_cast<std::int64_t>(found.size()), 1, [&](std::int64_t b) {
    Found& f = found[static_cast<std::size_t>(b)];
    for (std::int64_t i = b * kBlock; i < std::min(simplices_->size(), (b + 1) * kBlock); ++i) {
      const Sorted s = sorted(i);
      const Stencil<Dim>& all = stencil<Dim>(s.pattern);
      f.pieces += static_cast<std::int64_t>(all.choices[choice_of(s, all)].size());
      for (int e = 0; e < T::kEdges; ++e)
        if (s.cuts >> e & 1) f.edges.push_back({s.corner[T::kEdge[e][0]], s.corner[T::kEdge[e][1]]});
      for (int t = 0; t < T::kFaces; ++t) {
        const auto& e = T::kFaceEdge[t];
        const auto& k = T::kFace[t];
        if (s.cuts >> e[0] & s.cuts >> e[1] & s.cuts >> e[2] & 1)
          f.triangles.push_back({s.corner[k[0]], s.corner[k[1]], s.corner[k[2]]});
      }
      if (has_inner(s)) f.inner.push_back(s.corner);
    }
  });
  for (Found& f : found) {
    edges_.insert(edges_.end(), f.edges.begin(), f.edges.end());
    triangles_.insert(triangles_.end(), f.triangles.begin(), f.triangles.end());
    inner_first_.push_back(static_cast<std::int64_t>(inner_.size()));
    inner_.insert(inner_.end(), f.inner.begin(), f.inner.end());
    pieces_.push_back(f.pieces);
    f = {};
  }
  piece_count_ = exclusive_scan(std::span(pieces_));
  const auto make_unique = [&](auto& values) {
    parallel_sort(execution_, values);
    values.erase(std::unique(values.begin(), values.end()), values.end());
  };
  make_unique(edges_);
  make_unique(triangles_);
}

template <int Dim>
Vec<Dim> ReferenceCutter<Dim>::cut_point(const Edge& edge) const {
  const Vec<Dim>&a = mesh_.points[edge[0]], &b = mesh_.points[edge[1]];
  double t = 0.5;
  if (places_ == ReferencePlaces::equal_weights) {
    const MaterialId at_a = label_[edge[0]], at_b = label_[edge[1]];
    const double ahead = field_.difference(a, at_a, at_b), behind = field_.difference(b, at_b, at_a);
    if (ahead + behind > 0) t = std::clamp(ahead / (ahead + behind), kLeastOfEdge, 1 - kLeastOfEdge);
  }
  return a + t * (b - a);
}

/// Of a triangle or tetrahedron all of whose corners have different labels.
template <int Dim>
template <std::size_t N>
Vec<Dim> ReferenceCutter<Dim>::equal_place(const std::array<VertexId, N>& corners) const {
  std::array<double, N> share;
  share.fill(1.0 / N);
  if (places_ == ReferencePlaces::equal_weights) {
    std::array<std::array<double, N>, N> weight;  // of each corner's label at each corner
    for (std::size_t l = 0; l < N; ++l)
      for (std::size_t k = 0; k < N; ++k) weight[l][k] = field_.weight(mesh_.points[corners[k]], label_[corners[l]]);
    share = equal_point<static_cast<int>(N)>(weight);
  }
  Vec<Dim> x{};
  for (std::size_t k = 0; k < N; ++k) x = x + share[k] * mesh_.points[corners[k]];
  return x;
}

template <int Dim>
void ReferenceCutter<Dim>::place_points(Mesh<Dim>& out, ReferenceReport& report) {
  report.cut_edges = static_cast<std::int64_t>(edges_.size());
  report.triple_points = static_cast<std::int64_t>(triangles_.size());
  report.inner_points = static_cast<std::int64_t>(inner_.size());
  const std::size_t total = mesh_.points.size() + edges_.size() + triangles_.size() + inner_.size();
  if (total >= kOutside)
    throw Error(ErrorKind::limits, "--min-size: the mesh needs more than 2^32 vertices; choose larger cells");
  first_cut_ = static_cast<VertexId>(mesh_.points.size());
  first_triple_ = first_cut_ + static_cast<VertexId>(edges_.size());
  first_inner_ = first_triple_ + static_cast<VertexId>(triangles_.size());
  out.points = mesh_.points;
  out.points.resize(total);
  parallel_for(execution_, report.cut_edges, 512, [&](std::int64_t i) {
    out.points[first_cut_ + static_cast<std::size_t>(i)] = cut_point(edges_[static_cast<std::size_t>(i)]);
  });
  parallel_for(execution_, report.triple_points, 512, [&](std::int64_t i) {
    out.points[first_triple_ + static_cast<std::size_t>(i)] = equal_place(triangles_[static_cast<std::size_t>(i)]);
  });
  parallel_for(execution_, report.inner_points, 512, [&](std::int64_t i) {
    out.points[first_inner_ + static_cast<std::size_t>(i)] = equal_place(inner_[static_cast<std::size_t>(i)]);
  });
}

template <int Dim>
void ReferenceCutter<Dim>::write(Mesh<Dim>& out) const {
  CellBlock block;
  block.type = kSimplex<Dim>;
  block.vertices.resize(static_cast<std::size_t>(piece_count_) * (Dim + 1));
  block.materials.resize(static_cast<std::size_t>(piece_count_));
  parallel_for(execution_, static_cast<std::int64_t>(pieces_.size()), 1, [&](std::int64_t b) {
    std::int64_t at = pieces_[static_cast<std::size_t>(b)];
    auto inner = first_inner_ + static_cast<VertexId>(inner_first_[static_cast<std::size_t>(b)]);
    for (std::int64_t i = b * kBlock; i < std::min(simplices_->size(), (b + 1) * kBlock); ++i) {
      const Sorted s = sorted(i);
      write_pieces(s, inner, block, at);
      const Stencil<Dim>& all = stencil<Dim>(s.pattern);
      at += static_cast<std::int64_t>(all.choices[choice_of(s, all)].size());
      inner += has_inner(s);
    }
  });
  out.blocks.push_back(std::move(block));
}

template <int Dim>
void ReferenceCutter<Dim>::write_pieces(const Sorted& s, VertexId inner, CellBlock& block, std::int64_t at) const {
  std::array<VertexId, T::kPoints + 1> number{};
  std::copy(s.corner.begin(), s.corner.end(), number.begin());
  const auto place = [](const auto& all, const auto& key) {
    return static_cast<VertexId>(std::ranges::lower_bound(all, key) - all.begin());
  };
  for (int e = 0; e < T::kEdges; ++e)
    if (s.cuts >> e & 1)
      number[T::kCut + e] = first_cut_ + place(edges_, Edge{s.corner[T::kEdge[e][0]], s.corner[T::kEdge[e][1]]});
  for (int t = 0; t < T::kFaces; ++t) {
    const auto& e = T::kFaceEdge[t];
    const auto& k = T::kFace[t];
    if (s.cuts >> e[0] & s.cuts >> e[1] & s.cuts >> e[2] & 1)
      number[T::kTriple + t] =
          first_triple_ + place(triangles_, Triangle{s.corner[k[0]], s.corner[k[1]], s.corner[k[2]]});
  }
  number[T::kInner] = inner;
  const Stencil<Dim>& all = stencil<Dim>(s.pattern);
  for (const auto& piece : all.choices[choice_of(s, all)]) {
    // Every piece has a corner, and all corners of a piece have one label: cuts lie between different ones.
    const auto corner = std::ranges::find_if(piece, [](std::uint8_t p) { return p <= Dim; });
    VertexId* vertices = block.vertices.data() + at * (Dim + 1);
    for (int k = 0; k <= Dim; ++k) vertices[k] = number[piece[k]];
    if (s.odd) std::swap(vertices[0], vertices[1]);
    block.materials[static_cast<std::size_t>(at++)] = label_[s.corner[*corner]];
  }
}

}  // namespace

template <int Dim>
Mesh<Dim> cut_by_reference(const Mesh<Dim>& mesh, const Field<Dim>& field, ReferencePlaces places,
                           const std::vector<std::int32_t>& image_labels, ReferenceReport& report,
                           Execution& execution) {
  const Execution::Stage stage(execution, "march");
  Mesh<Dim> out;
  out.labels = image_labels;
  ReferenceCutter<Dim>(mesh, field, places, execution).run(out, report);
  return out;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                          \
  template Mesh<DIM> cut_by_reference(const Mesh<DIM>&, const Field<DIM>&, ReferencePlaces, \
                                      const std::vector<std::int32_t>&, ReferenceReport&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
