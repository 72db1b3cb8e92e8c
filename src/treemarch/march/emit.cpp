#include "treemarch/march/emit.h"

#include <algorithm>
#include <array>
#include <bit>
#include <span>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 4096;

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
  MaterialId best = set.items()[0];
  float best_weight = field.weight(x, best);
  for (const MaterialId m : set.items().subspan(1)) {
    const float w = field.weight(x, m);
    if (w > best_weight || (w == best_weight && m == field.voxel_label(x))) best = m, best_weight = w;
  }
  return best;
}

template <int Dim>
class Emitter {
 public:
  using T = StencilTopology<Dim>;
  using Simplex = std::array<VertexId, Dim + 1>;
  using Local = typename CutGeometry<Dim>::Local;

  Emitter(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
          const CutGeometry<Dim>& geometry, const Field<Dim>& field, MaterialId left_out, Execution& execution)
      : lattice_(lattice),
        band_(band),
        snapped_(snapped),
        geometry_(geometry),
        field_(field),
        left_out_(left_out),
        execution_(execution),
        blocks_(block_count(static_cast<std::int64_t>(band.simplices().size()), kBlock)) {}

  EmitReport run(Mesh<Dim>& mesh) {
    number_points();
    settle_materials();
    mark_far_points();
    place_points(mesh);
    write(mesh);
    return {first_triple_ - first_cut_, geometry_.triple_count(), points_ - first_inner_};
  }

 private:
  [[nodiscard]] bool all_stay() const { return left_out_ == kOutside; }
  [[nodiscard]] VertexId final_number(std::int64_t point) const {
    return all_stay() ? static_cast<VertexId>(point) : used_.rank(point);
  }
  template <class F>
  void for_blocks(F&& f) const {
    parallel_for(execution_, blocks_, 1, [&](std::int64_t block) {
      const auto n = static_cast<std::int64_t>(band_.simplices().size());
      f(block, block * kBlock, std::min(n, (block + 1) * kBlock));
    });
  }
  [[nodiscard]] bool has_inner_point(SplitRecord split) const {
    if constexpr (Dim == 2)
      return false;
    else
      return split.pattern != 0 && stencil<Dim>(split.pattern).apex[split.choice] == T::kInner;
  }
  void number_points();
  void settle_materials();
  void mark_far_points();
  void place_points(Mesh<Dim>& mesh);
  void write(Mesh<Dim>& mesh);
  [[nodiscard]] Vec<Dim> point(std::int64_t number) const;
  [[nodiscard]] MaterialId material_of(std::span<const std::uint8_t> piece, const Simplex& simplex, Local& local) const;
  /// Numbers of the points of a stencil before any are left out.
  [[nodiscard]] std::array<std::int64_t, T::kPoints> numbers_of(const Simplex& simplex, const Local& local,
                                                                std::int64_t inner) const;

  const SimplexLattice<Dim>& lattice_;
  const Band<Dim>& band_;
  const SnappedLattice<Dim>& snapped_;
  const CutGeometry<Dim>& geometry_;
  const Field<Dim>& field_;
  MaterialId left_out_;
  Execution& execution_;
  std::int64_t blocks_;
  std::vector<std::int64_t> first_piece_, first_inner_of_;  // per block
  std::vector<std::vector<MaterialId>> materials_;          // of all pieces, per block
  // Points are numbered: lattice vertices, cuts, triple points, inner points.
  std::int64_t first_cut_ = 0, first_triple_ = 0, first_inner_ = 0, points_ = 0;
  std::vector<EdgeId> cut_number_;  // of each edge, among those that are cut
  std::vector<EdgeId> cut_edge_;    // the other way round
  std::vector<Vec<Dim>> inner_;
  RankedBits used_;  // points of the cells that stay, if any are left out
};

template <int Dim>
void Emitter<Dim>::number_points() {
  first_cut_ = static_cast<std::int64_t>(lattice_.vertices.size());
  cut_number_.assign(snapped_.edges.size(), 0);
  for (std::size_t e = 0; e < cut_number_.size(); ++e)
    if (snapped_.cut[e] >= 0) {
      cut_number_[e] = static_cast<EdgeId>(cut_edge_.size());
      cut_edge_.push_back(static_cast<EdgeId>(e));
    }
  first_inner_of_.assign(blocks_, 0);
  for_blocks([&](std::int64_t block, std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) first_inner_of_[block] += has_inner_point(geometry_.split(i));
  });
  inner_.resize(exclusive_scan(std::span(first_inner_of_)));
  first_triple_ = first_cut_ + static_cast<std::int64_t>(cut_edge_.size());
  first_inner_ = first_triple_ + geometry_.triple_count();
  points_ = first_inner_ + static_cast<std::int64_t>(inner_.size());
  if (points_ >= static_cast<std::int64_t>(kOutside))
    throw Error(ErrorKind::limits, "--min-size: the mesh needs more than 2^32 vertices; choose larger cells");
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

/// Decides the material of every piece, counts those that stay and marks their points.
template <int Dim>
void Emitter<Dim>::settle_materials() {
  used_ = RankedBits(all_stay() ? 0 : points_);
  first_piece_.assign(blocks_, 0);
  materials_.resize(blocks_);
  constexpr std::array<std::uint8_t, 4> kWhole{0, 1, 2, 3};
  for_blocks([&](std::int64_t block, std::int64_t begin, std::int64_t end) {
    std::vector<MaterialId>& materials = materials_[block];
    materials.reserve(end - begin);
    std::int64_t inner = first_inner_of_[block];
    for (std::int64_t i = begin; i < end; ++i) {
      const Simplex& simplex = band_.simplices()[i];
      const SplitRecord split = geometry_.split(i);
      Local local;
      if (split.pattern == 0) {
        materials.push_back(material_of(std::span(kWhole).first(Dim + 1), simplex, local));
        if (materials.back() == left_out_) continue;
        ++first_piece_[block];
        if (!all_stay())
          for (const VertexId v : simplex) used_.insert(v);
        continue;
      }
      geometry_.find_cuts(simplex, local);
      const auto number = numbers_of(simplex, local, first_inner_ + inner);
      if (has_inner_point(split)) {
        geometry_.place(simplex, local);
        inner_[inner++] = local.point[T::kInner % T::kPoints];
      }
      for (const auto& piece : stencil<Dim>(split.pattern).choices[split.choice]) {
        materials.push_back(material_of(piece, simplex, local));
        if (materials.back() == left_out_) continue;
        ++first_piece_[block];
        if (!all_stay())
          for (const std::uint8_t p : piece) used_.insert(number[p]);
      }
    }
  });
}

template <int Dim>
std::array<std::int64_t, StencilTopology<Dim>::kPoints> Emitter<Dim>::numbers_of(const Simplex& simplex,
                                                                                 const Local& local,
                                                                                 std::int64_t inner) const {
  std::array<std::int64_t, T::kPoints> number{};
  for (int k = 0; k <= Dim; ++k) number[k] = simplex[k];
  for (int e = 0; e < T::kEdges; ++e)
    if (local.cuts >> e & 1) number[T::kCut + e] = first_cut_ + cut_number_[local.edge[e]];
  for (int f = 0; f < T::kFaces; ++f)
    if (local.triple[f] >= 0) number[T::kTriple + f] = first_triple_ + local.triple[f];
  if constexpr (Dim == 3) number[T::kInner] = inner;
  return number;
}

template <int Dim>
void Emitter<Dim>::mark_far_points() {
  if (all_stay()) return;
  band_.for_far(snapped_.labels, execution_, [&](std::int64_t, const Simplex& simplex, MaterialId) {
    for (const VertexId v : simplex) used_.insert(v);
  });
  used_.number(execution_);
}

template <int Dim>
Vec<Dim> Emitter<Dim>::point(std::int64_t number) const {
  if (number < first_cut_) return geometry_.vertex_point(static_cast<VertexId>(number));
  if (number < first_triple_) return geometry_.cut_point(cut_edge_[number - first_cut_]);
  if (number < first_inner_) return geometry_.triple_point(number - first_triple_);
  return inner_[number - first_inner_];
}

template <int Dim>
void Emitter<Dim>::place_points(Mesh<Dim>& mesh) {
  if (all_stay()) {
    mesh.points.resize(points_);
    parallel_for(execution_, points_, kBlock, [&](std::int64_t p) { mesh.points[p] = point(p); });
    return;
  }
  const auto& words = used_.words();
  mesh.points.resize(
      words.empty() ? 0 : used_.rank(64 * static_cast<std::int64_t>(words.size()) - 1) + (words.back() >> 63));
  parallel_for(execution_, static_cast<std::int64_t>(words.size()), kBlock / 64, [&](std::int64_t w) {
    std::size_t next = used_.first_of_word(static_cast<std::size_t>(w));
    for (std::uint64_t rest = words[w]; rest != 0; rest &= rest - 1)
      mesh.points[next++] = point(64 * w + std::countr_zero(rest));
  });
}

template <int Dim>
void Emitter<Dim>::write(Mesh<Dim>& mesh) {
  const std::int64_t far = band_.far_count(), pieces = exclusive_scan(std::span(first_piece_));
  CellBlock cells;
  cells.type = kSimplex<Dim>;
  cells.vertices.resize((far + pieces) * (Dim + 1));
  cells.materials.resize(far + pieces);
  band_.for_far(snapped_.labels, execution_, [&](std::int64_t i, const Simplex& simplex, MaterialId material) {
    for (int k = 0; k <= Dim; ++k) cells.vertices[i * (Dim + 1) + k] = final_number(simplex[k]);
    cells.materials[i] = material;
  });
  for_blocks([&](std::int64_t block, std::int64_t begin, std::int64_t end) {
    std::int64_t next = far + first_piece_[block], inner = first_inner_ + first_inner_of_[block];
    auto material = materials_[block].begin();
    for (std::int64_t i = begin; i < end; ++i) {
      const Simplex& simplex = band_.simplices()[i];
      const SplitRecord split = geometry_.split(i);
      if (split.pattern == 0) {
        const MaterialId m = *material++;
        if (m == left_out_) continue;
        for (int k = 0; k <= Dim; ++k) cells.vertices[next * (Dim + 1) + k] = final_number(simplex[k]);
        cells.materials[next++] = m;
        continue;
      }
      Local local;
      geometry_.find_cuts(simplex, local);
      const auto number = numbers_of(simplex, local, inner);
      inner += has_inner_point(split);
      for (const auto& piece : stencil<Dim>(split.pattern).choices[split.choice]) {
        const MaterialId m = *material++;
        if (m == left_out_) continue;
        for (int k = 0; k <= Dim; ++k) cells.vertices[next * (Dim + 1) + k] = final_number(number[piece[k]]);
        cells.materials[next++] = m;
      }
    }
    std::vector<MaterialId>().swap(materials_[block]);
  });
  mesh.blocks.push_back(std::move(cells));
}

}  // namespace

template <int Dim>
EmitReport emit_pieces(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
                       const CutGeometry<Dim>& geometry, const Field<Dim>& field, MaterialId left_out, Mesh<Dim>& mesh,
                       Execution& execution) {
  return Emitter<Dim>(lattice, band, snapped, geometry, field, left_out, execution).run(mesh);
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                          \
  template EmitReport emit_pieces(const SimplexLattice<DIM>&, const Band<DIM>&, const SnappedLattice<DIM>&, \
                                  const CutGeometry<DIM>&, const Field<DIM>&, MaterialId, Mesh<DIM>&, Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
