#include "treemarch/march/cut.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/classify.h"
#include "treemarch/march/retreat.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 4096;

/// The material of a piece: the label that all its lattice vertices share; else the heaviest label at its centroid.
template <int Dim>
MaterialId material_of(const std::array<std::uint8_t, Dim + 1>& piece, const std::array<VertexId, Dim + 1>& simplex,
                       const std::array<Vec<Dim>, StencilTopology<Dim>::kPoints>& point, const VertexLabels& labels,
                       const Field<Dim>& field) {
  LabelSet shared;
  bool first = true;
  Vec<Dim> centroid{};
  for (const std::uint8_t p : piece) {
    centroid = centroid + (1.0 / (Dim + 1)) * point[p];
    if (p > Dim) continue;
    if (first)
      shared = labels.set_of(simplex[p]);
    else
      shared.intersect(labels.of(simplex[p]));
    first = false;
  }
  if (shared.size() == 1) return shared.items()[0];
  if (shared.size() == 0)
    for (const VertexId v : simplex)
      for (const MaterialId m : labels.of(v)) shared.insert(m);
  MaterialId best = shared.items()[0];
  float best_weight = field.weight(centroid, best);
  for (const MaterialId m : shared.items().subspan(1)) {
    const float w = field.weight(centroid, m);
    if (w > best_weight || (w == best_weight && m == field.voxel_label(centroid))) best = m, best_weight = w;
  }
  return best;
}

/// Numbers the points and writes the pieces.
template <int Dim>
class Emitter {
 public:
  using T = StencilTopology<Dim>;

  Emitter(const SimplexLattice<Dim>& lattice, const SnappedLattice<Dim>& snapped, const CutGeometry<Dim>& geometry,
          const Field<Dim>& field, Execution& execution)
      : lattice_(lattice), snapped_(snapped), geometry_(geometry), field_(field), execution_(execution) {}

  void run(Mesh<Dim>& mesh, CutReport& report) {
    count();
    number_points(mesh, report);
    write(mesh);
  }

 private:
  struct Counts {
    std::int64_t pieces = 0, inner = 0;
  };

  template <class F>
  void for_block(std::int64_t block, F&& f) const {
    const auto n = static_cast<std::int64_t>(lattice_.simplices.size());
    for (std::int64_t i = block * kBlock; i < std::min(n, (block + 1) * kBlock); ++i) f(i);
  }
  void count();
  void number_points(Mesh<Dim>& mesh, CutReport& report);
  void write(Mesh<Dim>& mesh) const;

  const SimplexLattice<Dim>& lattice_;
  const SnappedLattice<Dim>& snapped_;
  const CutGeometry<Dim>& geometry_;
  const Field<Dim>& field_;
  Execution& execution_;
  std::vector<Counts> first_;  // per block
  std::int64_t pieces_ = 0, first_cut_ = 0, first_triple_ = 0, first_inner_ = 0;
  std::vector<VertexId> cut_number_;
};

template <int Dim>
void Emitter<Dim>::count() {
  const auto n = static_cast<std::int64_t>(lattice_.simplices.size());
  first_.resize(block_count(n, kBlock));
  parallel_for(execution_, static_cast<std::int64_t>(first_.size()), 1, [&](std::int64_t block) {
    Counts& counts = first_[block];
    for_block(block, [&](std::int64_t i) {
      const SplitRecord split = geometry_.split(i);
      if (split.pattern == 0) {
        ++counts.pieces;
        return;
      }
      const Stencil<Dim>& all = stencil<Dim>(split.pattern);
      counts.pieces += static_cast<std::int64_t>(all.choices[split.choice].size());
      counts.inner += Dim == 3 && all.apex[split.choice] == T::kInner;
    });
  });
  Counts sum;
  for (Counts& c : first_) {
    const Counts here = c;
    c = sum;
    sum.pieces += here.pieces;
    sum.inner += here.inner;
  }
  pieces_ = sum.pieces;
  first_inner_ = sum.inner;  // until the other points are numbered
}

template <int Dim>
void Emitter<Dim>::number_points(Mesh<Dim>& mesh, CutReport& report) {
  const std::int64_t inner = first_inner_;
  first_cut_ = static_cast<std::int64_t>(lattice_.vertices.size());
  cut_number_.assign(snapped_.edges.size(), 0);
  std::int64_t next = first_cut_;
  for (std::size_t e = 0; e < cut_number_.size(); ++e)
    if (snapped_.cut[e] >= 0) cut_number_[e] = static_cast<VertexId>(next++);
  first_triple_ = next;
  first_inner_ = first_triple_ + geometry_.triple_count();
  if (first_inner_ + inner >= static_cast<std::int64_t>(kOutside))
    throw Error(ErrorKind::limits, "--min-size: the mesh needs more than 2^32 vertices; choose larger cells");
  mesh.points.resize(first_inner_ + inner);
  parallel_for(execution_, first_cut_, kBlock,
               [&](std::int64_t v) { mesh.points[v] = geometry_.vertex_point(static_cast<VertexId>(v)); });
  parallel_for(execution_, static_cast<std::int64_t>(cut_number_.size()), kBlock, [&](std::int64_t e) {
    if (snapped_.cut[e] >= 0) mesh.points[cut_number_[e]] = geometry_.cut_point(static_cast<EdgeId>(e));
  });
  parallel_for(execution_, geometry_.triple_count(), kBlock,
               [&](std::int64_t t) { mesh.points[first_triple_ + t] = geometry_.triple_point(t); });
  report.cut_edges = first_triple_ - first_cut_;
  report.triple_points = geometry_.triple_count();
  report.inner_points = inner;
}

template <int Dim>
void Emitter<Dim>::write(Mesh<Dim>& mesh) const {
  CellBlock block;
  block.type = kSimplex<Dim>;
  block.vertices.resize(pieces_ * (Dim + 1));
  block.materials.resize(pieces_);
  parallel_for(execution_, static_cast<std::int64_t>(first_.size()), 1, [&](std::int64_t b) {
    std::int64_t next = first_[b].pieces;
    std::int64_t next_inner = first_inner_ + first_[b].inner;
    for_block(b, [&](std::int64_t i) {
      const auto& simplex = lattice_.simplices[i];
      const SplitRecord split = geometry_.split(i);
      if (split.pattern == 0) {
        std::copy(simplex.begin(), simplex.end(), block.vertices.begin() + next * (Dim + 1));
        if (!geometry_.touched(simplex)) {
          block.materials[next++] = snapped_.labels.of(simplex[0])[0];
          return;
        }
        std::array<std::uint8_t, Dim + 1> whole;
        std::array<Vec<Dim>, T::kPoints> point{};
        for (int k = 0; k <= Dim; ++k) whole[k] = static_cast<std::uint8_t>(k), point[k] = mesh.points[simplex[k]];
        block.materials[next++] = material_of<Dim>(whole, simplex, point, snapped_.labels, field_);
        return;
      }
      const auto local = geometry_.local(simplex);
      const Stencil<Dim>& all = stencil<Dim>(split.pattern);
      std::array<VertexId, T::kPoints> number{};
      for (int k = 0; k <= Dim; ++k) number[k] = simplex[k];
      for (int e = 0; e < T::kEdges; ++e)
        if (local.cuts >> e & 1) number[T::kCut + e] = cut_number_[local.edge[e]];
      for (int f = 0; f < T::kFaces; ++f)
        if (local.triple[f] >= 0) number[T::kTriple + f] = static_cast<VertexId>(first_triple_ + local.triple[f]);
      if constexpr (Dim == 3)
        if (all.apex[split.choice] == T::kInner) {
          number[T::kInner] = static_cast<VertexId>(next_inner);
          mesh.points[next_inner++] = local.point[T::kInner];
        }
      for (const auto& piece : all.choices[split.choice]) {
        for (int k = 0; k <= Dim; ++k) block.vertices[next * (Dim + 1) + k] = number[piece[k]];
        block.materials[next++] = material_of<Dim>(piece, simplex, local.point, snapped_.labels, field_);
      }
    });
  });
  mesh.blocks.push_back(std::move(block));
}

}  // namespace

template <int Dim>
Mesh<Dim> cut_lattice(const SimplexLattice<Dim>& lattice, const Field<Dim>& field,
                      const std::vector<std::int32_t>& image_labels, const CutOptions& options, CutReport& report,
                      Execution& execution) {
  const SnappedLattice<Dim> snapped =
      snap_vertices(lattice, classify_vertices(lattice, field, execution), field, options.snap, execution);
  execution.progress(0.5);
  CutGeometry<Dim> geometry(lattice, snapped, execution);
  geometry.retreat(options.quality_floor, execution);
  execution.progress(0.8);
  Mesh<Dim> mesh;
  mesh.labels = image_labels;
  Emitter<Dim>(lattice, snapped, geometry, field, execution).run(mesh, report);
  report.lattice_vertices = static_cast<std::int64_t>(lattice.vertices.size());
  report.lattice_simplices = static_cast<std::int64_t>(lattice.simplices.size());
  report.snapped_vertices = snapped.snapped;
  report.retreated_points = geometry.retreated;
  report.retreat_rounds = geometry.rounds;
  return mesh;
}

template Mesh<2> cut_lattice(const SimplexLattice<2>&, const Field<2>&, const std::vector<std::int32_t>&,
                             const CutOptions&, CutReport&, Execution&);
template Mesh<3> cut_lattice(const SimplexLattice<3>&, const Field<3>&, const std::vector<std::int32_t>&,
                             const CutOptions&, CutReport&, Execution&);

}  // namespace treemarch
