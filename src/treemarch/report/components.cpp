#include "treemarch/report/components.h"

#include <algorithm>

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

template std::vector<ImageComponent> image_components(const LabelImage<1>&);
template std::vector<ImageComponent> image_components(const LabelImage<2>&);
template std::vector<ImageComponent> image_components(const LabelImage<3>&);
template std::vector<ImageComponent> image_components(const LabelImage<4>&);

}  // namespace treemarch
