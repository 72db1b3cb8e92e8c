#include "treemarch/march/left_out.h"

#include <algorithm>

#include "treemarch/core/parallel.h"
#include "treemarch/march/band.h"

namespace treemarch {

/// \param concerns(star) whether a leaf has simplices that are wanted
template <int Dim>
template <class Concerns, class Wanted>
void LeftOutCells<Dim>::append(Mesh<Dim>& mesh, Concerns&& concerns, Wanted&& wanted, const Execution& execution) {
  struct Found {
    std::int64_t key;
    Simplex simplex;
  };
  const std::int64_t leaves = std::ssize(lattice_.leaves);
  std::vector<std::vector<Found>> found(static_cast<std::size_t>(block_count(leaves, kLeavesPerBlock)));
  parallel_for(execution, std::ssize(found), 1, [&](std::int64_t task) {
    std::array<Simplex, LeafStar<Dim>::kMostSimplices> listed;
    for (std::int64_t leaf = task * kLeavesPerBlock; leaf < std::min(leaves, (task + 1) * kLeavesPerBlock); ++leaf) {
      if (!places_.leaves[static_cast<std::size_t>(leaf)]) continue;
      const LeafStar<Dim> star = lattice_.star(static_cast<LeafId>(leaf));
      if (!concerns(star)) continue;
      const int count = star.simplices(listed);
      for (int i = 0; i < count; ++i) {
        const Simplex& simplex = listed[static_cast<std::size_t>(i)];
        if (!std::ranges::all_of(simplex, [&](VertexId v) { return places_.vertices[v]; }) || !wanted(simplex))
          continue;
        const std::int64_t key = leaf * LeafStar<Dim>::kMostSimplices + i;
        if (!std::ranges::binary_search(appended_, key))
          found[static_cast<std::size_t>(task)].push_back({key, simplex});
      }
    }
  });
  CellBlock& block = mesh.blocks[0];
  const std::size_t before = appended_.size();
  for (const auto& in_task : found)
    for (const Found& f : in_task) {
      block.vertices.insert(block.vertices.end(), f.simplex.begin(), f.simplex.end());
      block.materials.push_back(material_);
      appended_.push_back(f.key);
    }
  std::ranges::inplace_merge(appended_, appended_.begin() + static_cast<std::ptrdiff_t>(before));
}

template <int Dim>
void LeftOutCells<Dim>::append_at(Mesh<Dim>& mesh, const Marks& vertices, const Execution& execution) {
  const auto is_marked = [&](VertexId v) { return vertices[v]; };
  append(
      mesh, [&](const LeafStar<Dim>& star) { return !star.all_of([&](VertexId v) { return !vertices[v]; }); },
      [&](const Simplex& simplex) { return std::ranges::any_of(simplex, is_marked); }, execution);
}

template <int Dim>
void LeftOutCells<Dim>::append_if(Mesh<Dim>& mesh, const std::function<bool(const Simplex&)>& wanted,
                                  const Execution& execution) {
  append(
      mesh, [](const LeafStar<Dim>&) { return true; }, wanted, execution);
}

template class LeftOutCells<2>;
template class LeftOutCells<3>;

}  // namespace treemarch
