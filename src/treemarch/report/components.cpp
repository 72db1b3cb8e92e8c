#include "treemarch/report/components.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/facets.h"

namespace treemarch {
namespace {

/// A maximal stretch of one material along the first axis.
struct Run {
  MaterialId material;
  std::int32_t begin, end;
};

class DisjointSets {
 public:
  void add() { parent_.push_back(static_cast<std::uint32_t>(parent_.size())); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The smaller index stays the representative, so that it is the first in scan order.
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Joins runs of two rows that overlap and have the same material.
void join_rows(const std::vector<Run>& runs, std::size_t a, std::size_t a_end, std::size_t b, std::size_t b_end,
               DisjointSets& sets) {
  while (a < a_end && b < b_end) {
    if (runs[a].material == runs[b].material && runs[a].begin < runs[b].end && runs[b].begin < runs[a].end)
      sets.join(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
    if (runs[a].end <= runs[b].end)
      ++a;
    else
      ++b;
  }
}

}  // namespace

template <int Dim>
std::vector<ImageComponent> image_components(const LabelImage<Dim>& image) {
  const std::int64_t width = image.extent[0];
  const std::int64_t rows = width ? product(image.extent) / width : 0;
  std::vector<Run> runs;
  std::vector<std::size_t> row_begin{0};
  row_begin.reserve(static_cast<std::size_t>(rows) + 1);
  DisjointSets sets;
  image.voxels.visit([&](const auto* voxels) {
    for (std::int64_t row = 0; row < rows; ++row) {
      const auto* v = voxels + row * width;
      for (std::int32_t x = 0; x < width;) {
        const std::int32_t begin = x;
        while (x < width && v[x] == v[begin]) ++x;
        runs.push_back({static_cast<MaterialId>(v[begin]), begin, x});
        sets.add();
      }
      row_begin.push_back(runs.size());
      std::int64_t stride = 1;  // in rows, along axis d
      for (int d = 1; d < Dim; ++d) {
        if (row / stride % image.extent[d] > 0) {
          const auto before = static_cast<std::size_t>(row - stride);
          join_rows(runs, row_begin[before], row_begin[before + 1], row_begin[static_cast<std::size_t>(row)],
                    runs.size(), sets);
        }
        stride *= image.extent[d];
      }
    }
  });

  std::vector<ImageComponent> components;
  std::vector<std::uint32_t> component_of(runs.size());
  for (std::int64_t row = 0; row < rows; ++row) {
    for (std::size_t r = row_begin[static_cast<std::size_t>(row)]; r < row_begin[static_cast<std::size_t>(row) + 1];
         ++r) {
      const std::uint32_t root = sets.find(static_cast<std::uint32_t>(r));
      if (root == r) {
        component_of[r] = static_cast<std::uint32_t>(components.size());
        components.push_back({runs[r].material, 0, row * width + runs[r].begin});
      }
      components[component_of[root]].voxels += runs[r].end - runs[r].begin;
    }
  }
  return components;
}

namespace {

/// Disjoint sets that several threads may join at once. The roots are the smallest members whatever the order.
class SharedDisjointSets {
 public:
  using Index = std::uint32_t;
  explicit SharedDisjointSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), Index{0}); }

  Index find(Index i) {
    while (true) {
      Index up = at(i).load(std::memory_order_relaxed);
      if (up == i) return i;
      const Index above = at(up).load(std::memory_order_relaxed);
      if (above != up) at(i).compare_exchange_weak(up, above, std::memory_order_relaxed);
      i = above;
    }
  }
  void join(Index a, Index b) {
    while (true) {
      a = find(a);
      b = find(b);
      if (a == b) return;
      Index root = std::max(a, b);
      if (at(root).compare_exchange_strong(root, std::min(a, b), std::memory_order_relaxed)) return;
    }
  }
  [[nodiscard]] bool is_root(Index i) const { return parent_[i] == i; }

 private:
  std::atomic_ref<Index> at(Index i) { return std::atomic_ref(parent_[i]); }
  std::vector<Index> parent_;
};

}  // namespace

template <int Dim>
std::vector<std::int64_t> count_mesh_components(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::int64_t> first(mesh.blocks.size() + 1);  // number of the first cell of each block
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) first[b + 1] = first[b] + mesh.blocks[b].size();
  SharedDisjointSets sets(static_cast<std::size_t>(first.back()));
  const auto material = [&](const FacetSide& s) {
    return mesh.blocks[s.block].materials[static_cast<std::size_t>(s.cell)];
  };
  const auto number = [&](const FacetSide& s) { return static_cast<std::uint32_t>(first[s.block] + s.cell); };
  visit_facets(mesh, execution, [&](std::int64_t, std::span<const FacetSide> sides) {
    for (std::size_t i = 1; i < sides.size(); ++i)
      if (material(sides[i]) == material(sides[0])) sets.join(number(sides[0]), number(sides[i]));
  });
  std::vector<std::int64_t> count(mesh.labels.size());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    for (std::int64_t c = 0; c < mesh.blocks[b].size(); ++c)
      count[mesh.blocks[b].materials[static_cast<std::size_t>(c)]] +=
          sets.is_root(static_cast<std::uint32_t>(first[b] + c));
  return count;
}

template std::vector<std::int64_t> count_mesh_components(const Mesh<2>&, const Execution&);
template std::vector<std::int64_t> count_mesh_components(const Mesh<3>&, const Execution&);
template std::vector<ImageComponent> image_components(const LabelImage<1>&);
template std::vector<ImageComponent> image_components(const LabelImage<2>&);
template std::vector<ImageComponent> image_components(const LabelImage<3>&);
template std::vector<ImageComponent> image_components(const LabelImage<4>&);

}  // namespace treemarch
