#include "treemarch/topology/image_components.h"

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

/// The runs of an image in scan order, joined to components.
struct JoinedRuns {
  std::vector<Run> runs;
  std::vector<std::size_t> row_begin;  // of each row, and the end
  DisjointSets sets;
};

template <int Dim>
JoinedRuns join_runs(const LabelImage<Dim>& image) {
  const std::int64_t width = image.extent[0];
  const std::int64_t rows = width ? product(image.extent) / width : 0;
  JoinedRuns joined;
  auto& [runs, row_begin, sets] = joined;
  row_begin.reserve(static_cast<std::size_t>(rows) + 1);
  row_begin.push_back(0);
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
  return joined;
}

/// Lists the components; use(row, run, component) is called for every run.
template <class Use>
std::vector<ImageComponent> list_components(JoinedRuns& joined, std::int64_t width, Use&& use) {
  std::vector<ImageComponent> components;
  std::vector<std::uint32_t> component_of(joined.runs.size());
  for (std::size_t row = 0; row + 1 < joined.row_begin.size(); ++row) {
    for (std::size_t r = joined.row_begin[row]; r < joined.row_begin[row + 1]; ++r) {
      const Run& run = joined.runs[r];
      const std::uint32_t root = joined.sets.find(static_cast<std::uint32_t>(r));
      if (root == r) {
        component_of[r] = static_cast<std::uint32_t>(components.size());
        components.push_back({run.material, 0, static_cast<std::int64_t>(row) * width + run.begin});
      }
      components[component_of[root]].voxels += run.end - run.begin;
      use(static_cast<std::int64_t>(row), run, component_of[root]);
    }
  }
  return components;
}

}  // namespace

template <int Dim>
std::vector<ImageComponent> image_components(const LabelImage<Dim>& image) {
  JoinedRuns joined = join_runs(image);
  return list_components(joined, image.extent[0], [](std::int64_t, const Run&, std::uint32_t) {});
}

template <int Dim>
ComponentMap map_components(const LabelImage<Dim>& image) {
  JoinedRuns joined = join_runs(image);
  ComponentMap map;
  map.of_voxel.resize(static_cast<std::size_t>(product(image.extent)));
  const std::int64_t width = image.extent[0];
  map.components = list_components(joined, width, [&](std::int64_t row, const Run& run, std::uint32_t component) {
    const auto begin = map.of_voxel.begin() + row * width;
    std::fill(begin + run.begin, begin + run.end, component);
  });
  return map;
}

template std::vector<ImageComponent> image_components(const LabelImage<1>&);
template std::vector<ImageComponent> image_components(const LabelImage<2>&);
template std::vector<ImageComponent> image_components(const LabelImage<3>&);
template std::vector<ImageComponent> image_components(const LabelImage<4>&);
template ComponentMap map_components(const LabelImage<1>&);
template ComponentMap map_components(const LabelImage<2>&);
template ComponentMap map_components(const LabelImage<3>&);
template ComponentMap map_components(const LabelImage<4>&);

}  // namespace treemarch
