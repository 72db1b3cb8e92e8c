#include "treemarch/march/emit.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/field/junction.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 4096;  // points

/// The labels that the vertices share, or kOutside if that is not exactly one.
MaterialId only_shared_label(const VertexLabels& labels, std::span<const VertexId> vertices) {
  for (const VertexId v : vertices) {
    if (!labels.single(v)) continue;
    const MaterialId m = labels.of(v)[0];
    for (const VertexId w : vertices)
      if (!labels.contains(w, m)) return kOutside;
    return m;
  }
  if (vertices.empty()) return kOutside;
  LabelSet shared = labels.set_of(vertices[0]);
  for (const VertexId v : vertices.subspan(1)) shared.intersect(labels.of(v));
  return shared.size() == 1 ? shared.items()[0] : kOutside;
}

/// The heaviest at a point of the labels that all vertices of a piece share, or of all labels of its simplex if they
/// share none. The voxel's own label wins a tie.
template <int Dim>
MaterialId heaviest_label(const VertexLabels& labels, std::span<const VertexId> shared_by,
                          const std::array<VertexId, Dim + 1>& simplex, const Field<Dim>& field, const Vec<Dim>& x) {
  LabelSet set;
  if (!shared_by.empty()) set = labels.set_of(shared_by[0]);
  for (const VertexId v : shared_by) set.intersect(labels.of(v));
  if (set.size() == 0)
    for (const VertexId v : simplex)
      for (const MaterialId m : labels.of(v)) set.insert(m);
  return heaviest<Dim>(field, x, set.items());
}

template <int Dim>
class Emitter {
 public:
  using T = StencilTopology<Dim>;
  using Simplex = std::array<VertexId, Dim + 1>;
  using Local = typename CutGeometry<Dim>::Local;

  Emitter(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
          const CutGeometry<Dim>& geometry, const Field<Dim>& field, Execution& execution)
      : lattice_(lattice),
        band_(band),
        snapped_(snapped),
        geometry_(geometry),
        field_(field),
        execution_(execution),
        first_(band.blocks()) {}

  EmitReport run(Mesh<Dim>& mesh) {
    count();
    number_cuts();
    place_points(mesh);
    write(mesh);
    return {first_triple_ - first_cut_, geometry_.triple_count(), inner_};
  }

 private:
  struct Counts {
    std::int64_t pieces = 0, inner = 0;
    Counts& operator+=(const Counts& other) {
      pieces += other.pieces;
      inner += other.inner;
      return *this;
    }
  };
  [[nodiscard]] static bool has_inner_point(SplitRecord split) {
    if constexpr (Dim == 2)
      return false;
    else
      return split.pattern != 0 && stencil<Dim>(split.pattern).apex[split.choice] == T::kInner;
  }
  void count();
  void number_cuts();
  void place_points(Mesh<Dim>& mesh) const;
  void write(Mesh<Dim>& mesh) const;
  [[nodiscard]] MaterialId material_of(std::span<const std::uint8_t> piece, const Simplex& simplex, Local& local) const;
  /// \pre one vertex has a single label.
  [[nodiscard]] MaterialId first_single_label(const Simplex& simplex) const {
    return snapped_.labels.of(*std::ranges::find_if(simplex, [&](VertexId v) { return snapped_.labels.single(v); }))[0];
  }
  [[nodiscard]] std::array<VertexId, T::kPoints> numbers_of(const Simplex& simplex, const Local& local,
                                                            std::int64_t inner) const;

  const SimplexLattice<Dim>& lattice_;
  const Band<Dim>& band_;
  const SnappedLattice<Dim>& snapped_;
  const CutGeometry<Dim>& geometry_;
  const Field<Dim>& field_;
  Execution& execution_;
  std::vector<Counts> first_;  // per block of the band
  std::int64_t pieces_ = 0, inner_ = 0;
  // Points are numbered: lattice vertices, cuts, triple points, inner points.
  std::int64_t first_cut_ = 0, first_triple_ = 0, first_inner_ = 0;
  RawVector<VertexId> cut_number_;  // of each edge that is cut
};

template <int Dim>
void Emitter<Dim>::count() {
  parallel_for(execution_, band_.blocks(), 1, [&](std::int64_t block) {
    for (const SplitRecord split : geometry_.splits(block)) {
      first_[block].pieces +=
          split.pattern == 0 ? 1 : static_cast<std::int64_t>(stencil<Dim>(split.pattern).choices[split.choice].size());
      first_[block].inner += has_inner_point(split);
    }
  });
  const Counts total = exclusive_scan(std::span(first_));
  pieces_ = total.pieces;
  inner_ = total.inner;
}

template <int Dim>
void Emitter<Dim>::number_cuts() {
  first_cut_ = static_cast<std::int64_t>(lattice_.vertices.size());
  cut_number_.resize(snapped_.edges.size());
  std::int64_t next = first_cut_;
  for (std::size_t e = 0; e < cut_number_.size(); ++e)
    if (snapped_.cut[e] >= 0) cut_number_[e] = static_cast<VertexId>(next++);
  first_triple_ = next;
  first_inner_ = first_triple_ + geometry_.triple_count();
  if (first_inner_ + inner_ >= static_cast<std::int64_t>(kOutside))
    throw Error(ErrorKind::limits, "--min-size: the mesh needs more than 2^32 vertices; choose larger cells");
}

/// Cuts and triple points; the vertices have their places.
template <int Dim>
void Emitter<Dim>::place_points(Mesh<Dim>& mesh) const {
  mesh.points.resize(first_inner_ + inner_);
  parallel_for(execution_, static_cast<std::int64_t>(cut_number_.size()), kBlock, [&](std::int64_t e) {
    if (snapped_.cut[e] >= 0) mesh.points[cut_number_[e]] = geometry_.cut_point(static_cast<EdgeId>(e));
  });
  parallel_for(execution_, geometry_.triple_count(), kBlock,
               [&](std::int64_t t) { mesh.points[first_triple_ + t] = geometry_.triple_point(t); });
}

template <int Dim>
MaterialId Emitter<Dim>::material_of(std::span<const std::uint8_t> piece, const Simplex& simplex, Local& local) const {
  std::array<VertexId, Dim + 1> corner;
  int corners = 0;
  for (const std::uint8_t p : piece)
    if (p <= Dim) corner[corners++] = simplex[p];
  const auto shared_by = std::span<const VertexId>(corner).first(corners);
  if (const MaterialId m = only_shared_label(snapped_.labels, shared_by); m != kOutside) return m;
  if (!local.placed) geometry_.place(simplex, local);
  Vec<Dim> centroid{};
  for (const std::uint8_t p : piece) centroid = centroid + (1.0 / (Dim + 1)) * local.point[p];
  return heaviest_label(snapped_.labels, shared_by, simplex, field_, centroid);
}

template <int Dim>
std::array<VertexId, StencilTopology<Dim>::kPoints> Emitter<Dim>::numbers_of(const Simplex& simplex, const Local& local,
                                                                             std::int64_t inner) const {
  std::array<VertexId, T::kPoints> number{};
  for (int k = 0; k <= Dim; ++k) number[k] = simplex[k];
  for (int e = 0; e < T::kEdges; ++e)
    if (local.cuts >> e & 1) number[T::kCut + e] = cut_number_[local.edge[e]];
  for (int f = 0; f < T::kFaces; ++f)
    if (local.triple[f] >= 0) number[T::kTriple + f] = static_cast<VertexId>(first_triple_ + local.triple[f]);
  if constexpr (Dim == 3) number[T::kInner] = static_cast<VertexId>(inner);
  return number;
}

template <int Dim>
void Emitter<Dim>::write(Mesh<Dim>& mesh) const {
  constexpr std::array<std::uint8_t, 4> kWhole{0, 1, 2, 3};
  const std::int64_t far = band_.far_count();
  CellBlock cells;
  cells.type = kSimplex<Dim>;
  // With room for what is left out, some of which may be asked for later.
  cells.vertices.reserve((far + pieces_ + band_.left_out_count()) * (Dim + 1));
  cells.materials.reserve(far + pieces_ + band_.left_out_count());
  cells.vertices.resize((far + pieces_) * (Dim + 1));
  cells.materials.resize(far + pieces_);
  band_.for_far(execution_, [&](std::int64_t i, const Simplex& simplex, MaterialId material) {
    std::ranges::copy(simplex, cells.vertices.begin() + i * (Dim + 1));
    cells.materials[i] = material;
  });
  parallel_for(execution_, band_.blocks(), 1, [&](std::int64_t block) {
    std::int64_t next = far + first_[block].pieces, inner = first_inner_ + first_[block].inner;
    const auto simplices = band_.simplices(block);
    for (std::size_t i = 0; i < simplices.size(); ++i) {
      const Simplex& simplex = simplices[i];
      const SplitRecord split = geometry_.splits(block)[i];
      Local local;
      if (split.pattern == 0) {
        std::ranges::copy(simplex, cells.vertices.begin() + next * (Dim + 1));
        cells.materials[next++] = band_.cuts(block)[i] == Band<Dim>::kOneLabel
                                      ? first_single_label(simplex)
                                      : material_of(std::span(kWhole).first(Dim + 1), simplex, local);
        continue;
      }
      geometry_.find_cuts(simplex, band_.cuts(block)[i], local);
      const auto number = numbers_of(simplex, local, inner);
      if (has_inner_point(split)) {
        geometry_.place(simplex, local);
        mesh.points[inner++] = local.point[T::kInner % T::kPoints];
      }
      for (const auto& piece : stencil<Dim>(split.pattern).choices[split.choice]) {
        for (int k = 0; k <= Dim; ++k) cells.vertices[next * (Dim + 1) + k] = number[piece[k]];
        cells.materials[next++] = material_of(piece, simplex, local);
      }
    }
  });
  mesh.blocks.push_back(std::move(cells));
}

}  // namespace

template <int Dim>
EmitReport emit_pieces(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
                       const CutGeometry<Dim>& geometry, const Field<Dim>& field, Mesh<Dim>& mesh,
                       Execution& execution) {
  return Emitter<Dim>(lattice, band, snapped, geometry, field, execution).run(mesh);
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                          \
  template EmitReport emit_pieces(const SimplexLattice<DIM>&, const Band<DIM>&, const SnappedLattice<DIM>&, \
                                  const CutGeometry<DIM>&, const Field<DIM>&, Mesh<DIM>&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
