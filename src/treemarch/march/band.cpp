#include "treemarch/march/band.h"

#include <algorithm>

namespace treemarch {

template <int Dim>
Band<Dim>::Band(const SimplexLattice<Dim>& lattice, const VertexLabels& labels, MaterialId left_out,
                Execution& execution)
    : lattice_(lattice),
      labels_(labels),
      left_out_(left_out),
      first_far_(block_count(static_cast<std::int64_t>(lattice.leaves.size()), kLeavesPerBlock)),
      leaves_far_(lattice.leaves.size()),
      leaves_left_out_(lattice.leaves.size()) {
  const auto blocks = static_cast<std::int64_t>(first_far_.size());
  parts_.resize(blocks);
  std::vector<std::int64_t> left_out_in(blocks);
  parallel_for_ranges(execution, blocks, 1, [&](std::int64_t begin, std::int64_t end) {
    Part found;
    for (std::int64_t b = begin; b < end; ++b) {
      found.simplices.clear();
      found.cuts.clear();
      found.triangles.clear();
      std::int64_t far = 0;
      sort_block(
          b, [](std::int64_t) { return true; }, [&](const Simplex& simplex) { find_cuts(simplex, found); },
          [&](LeafId leaf, const Simplex&, MaterialId material) {
            (material == left_out_ ? leaves_left_out_ : leaves_far_).mark(leaf);
            ++(material == left_out_ ? left_out_in[b] : far);
          });
      parts_[b] = found;
      first_far_[b] = far;
    }
  });
  far_count_ = exclusive_scan(std::span(first_far_));
  left_out_count_ = exclusive_scan(std::span(left_out_in));
  first_.reserve(parts_.size() + 1);
  for (const Part& part : parts_) first_.push_back(std::ssize(part.simplices));
  first_.push_back(0);
  exclusive_scan(std::span(first_));
  list_triangles(execution);
}

template <int Dim>
void Band<Dim>::find_cuts(const Simplex& simplex, Part& part) const {
  using T = StencilTopology<Dim>;
  unsigned cuts = 0;
  // Mostly all vertices share the label of one that has no other.
  const auto alone = std::ranges::find_if(simplex, [&](VertexId v) { return labels_.single(v); });
  const bool shared = alone != simplex.end() && std::ranges::all_of(simplex, [&](VertexId v) {
                        return labels_.contains(v, labels_.of(*alone)[0]);
                      });
  if (shared) {
    part.simplices.push_back(simplex);
    part.cuts.push_back(kOneLabel);
    return;
  }
  for (int e = 0; e < T::kEdges; ++e)
    cuts |= (labels_.disjoint(simplex[T::kEdge[e][0]], simplex[T::kEdge[e][1]]) ? 1U : 0U) << e;
  part.simplices.push_back(simplex);
  part.cuts.push_back(static_cast<std::uint8_t>(cuts));
  for (int f = 0; f < T::kFaces && cuts != 0; ++f) {
    const auto& e = T::kFaceEdge[f];
    if ((cuts >> e[0] & cuts >> e[1] & cuts >> e[2] & 1) == 0) continue;
    Triangle t{simplex[T::kFace[f][0]], simplex[T::kFace[f][1]], simplex[T::kFace[f][2]]};
    std::sort(t.begin(), t.end());
    part.triangles.push_back(t);
  }
}

/// Each once, from the blocks, whose own lists are freed.
template <int Dim>
void Band<Dim>::list_triangles(Execution& execution) {
  for (Part& part : parts_) {
    triangles_.insert(triangles_.end(), part.triangles.begin(), part.triangles.end());
    part.triangles = {};
  }
  parallel_sort(execution, triangles_);
  triangles_.erase(std::unique(triangles_.begin(), triangles_.end()), triangles_.end());
}

template class Band<2>;
template class Band<3>;

}  // namespace treemarch
