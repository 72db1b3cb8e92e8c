#include "treemarch/topology/image_components.h"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/topology/disjoint_sets.h"

namespace treemarch {
namespace {

constexpr std::int64_t kRowsPerTask = 256;

/// A maximal stretch of one material along the first axis.
struct Run {
  MaterialId material;
  std::int32_t begin, end;
};

/// Joins runs of two rows that overlap and have the same material.
void join_rows(const std::vector<Run>& runs, std::size_t a, std::size_t a_end, std::size_t b, std::size_t b_end,
               SharedDisjointSets& sets) {
  while (a < a_end && b < b_end) {
    if (runs[a].material == runs[b].material && runs[a].begin < runs[b].end && runs[b].begin < runs[a].end)
      sets.join(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
    if (runs[a].end <= runs[b].end)
      ++a;
    else
      ++b;
  }
}

/// The runs of an image in scan order, joined to components. The first run of a component stands for it.
struct JoinedRuns {
  std::vector<Run> runs;
  std::vector<std::size_t> row_begin;  // of each row, and the end
  SharedDisjointSets sets;
};

/// Calls use(row, first voxel, one past the last) for every run, rows in parallel.
template <int Dim, class Use>
void for_each_run(const LabelImage<Dim>& image, const Execution& execution, Use&& use) {
  const std::int64_t width = image.extent[0], rows = width ? product(image.extent) / width : 0;
  image.voxels.visit([&](const auto* voxels) {
    parallel_for(execution, rows, kRowsPerTask, [&](std::int64_t row) {
      const auto* v = voxels + row * width;
      for (std::int32_t x = 0; x < width;) {
        const std::int32_t begin = x;
        while (x < width && v[x] == v[begin]) ++x;
        use(row, Run{static_cast<MaterialId>(v[begin]), begin, x});
      }
    });
  });
}

template <int Dim>
JoinedRuns join_runs(const LabelImage<Dim>& image, const Execution& execution) {
  const std::int64_t width = image.extent[0], rows = width ? product(image.extent) / width : 0;
  JoinedRuns joined;
  std::vector<Run>& runs = joined.runs;
  std::vector<std::size_t>& row_begin = joined.row_begin;
  SharedDisjointSets& sets = joined.sets;
  row_begin.assign(static_cast<std::size_t>(rows) + 1, 0);
  for_each_run(image, execution, [&](std::int64_t row, const Run&) { ++row_begin[static_cast<std::size_t>(row)]; });
  runs.resize(exclusive_scan(std::span(row_begin)));
  if (runs.size() > std::numeric_limits<std::uint32_t>::max())
    throw Error(ErrorKind::limits, "image: 2^32 or more runs of equal labels; crop or clean it");
  std::vector<std::size_t> next(row_begin.begin(), row_begin.end());
  for_each_run(image, execution,
               [&](std::int64_t row, const Run& run) { runs[next[static_cast<std::size_t>(row)]++] = run; });
  sets = SharedDisjointSets(runs.size(), execution);
  parallel_for(execution, rows, kRowsPerTask, [&](std::int64_t row) {
    const auto here = static_cast<std::size_t>(row);
    std::int64_t stride = 1;  // in rows, along axis d
    for (int d = 1; d < Dim; ++d) {
      if (row / stride % image.extent[d] > 0) {
        const auto before = static_cast<std::size_t>(row - stride);
        join_rows(runs, row_begin[before], row_begin[before + 1], row_begin[here], row_begin[here + 1], sets);
      }
      stride *= image.extent[d];
    }
  });
  return joined;
}

/// Lists the components. \param component_of of each run
std::vector<ImageComponent> list_components(const JoinedRuns& joined, std::int64_t width,
                                            std::vector<std::uint32_t>& component_of) {
  std::vector<ImageComponent> components;
  component_of.resize(joined.runs.size());
  for (std::size_t row = 0; row + 1 < joined.row_begin.size(); ++row) {
    for (std::size_t r = joined.row_begin[row]; r < joined.row_begin[row + 1]; ++r) {
      const Run& run = joined.runs[r];
      const std::uint32_t root = joined.sets.find(static_cast<std::uint32_t>(r));
      if (root == r) {
        component_of[r] = static_cast<std::uint32_t>(components.size());
        components.push_back({run.material, 0, static_cast<std::int64_t>(row) * width + run.begin});
      }
      component_of[r] = component_of[root];
      components[component_of[r]].voxels += run.end - run.begin;
    }
  }
  return components;
}

}  // namespace

std::vector<std::int64_t> largest_components(const std::vector<ImageComponent>& components, std::size_t materials) {
  std::vector<std::int64_t> largest(materials, -1);
  for (std::size_t c = 0; c < components.size(); ++c) {
    std::int64_t& best = largest[components[c].material];
    if (best < 0 || components[static_cast<std::size_t>(best)].voxels < components[c].voxels)
      best = static_cast<std::int64_t>(c);
  }
  return largest;
}

template <int Dim>
std::vector<ImageComponent> image_components(const LabelImage<Dim>& image, const Execution& execution) {
  std::vector<std::uint32_t> component_of;
  return list_components(join_runs(image, execution), image.extent[0], component_of);
}

template <int Dim>
ComponentMap map_components(const LabelImage<Dim>& image, const Execution& execution) {
  JoinedRuns joined = join_runs(image, execution);
  std::vector<std::uint32_t> component_of;
  ComponentMap map;
  map.width = image.extent[0];
  map.components = list_components(joined, map.width, component_of);
  map.runs.reserve(joined.runs.size());
  for (std::size_t r = 0; r < joined.runs.size(); ++r) map.runs.push_back({joined.runs[r].begin, component_of[r]});
  map.row_begin = std::move(joined.row_begin);
  return map;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                 \
  template std::vector<ImageComponent> image_components(const LabelImage<DIM>&, const Execution&); \
  template ComponentMap map_components(const LabelImage<DIM>&, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
