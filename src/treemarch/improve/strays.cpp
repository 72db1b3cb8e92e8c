#include "treemarch/improve/strays.h"

#include <algorithm>
#include <span>
#include <tuple>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 14;

template <int Dim>
bool holds_a_voxel(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::span<const CellId> cells) {
  const CellBlock& block = mesh.blocks[0];
  const MaterialId material = block.materials[cells[0]];
  const VoxelCentres<Dim> centres(image);
  bool any = false;
  for (const CellId c : cells)
    for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
      centres.visit(
          simplex, [&](std::int64_t v) { return !any && image.voxels[v] == material; },
          [&](std::int64_t) { any = true; });
    });
  return any;
}

/// A material beside some cells.
struct Beside {
  MaterialId material;
  std::uint32_t component;  // of the mesh, the first that was met
  bool several = false;     // components of it
  int facets = 0;
};

template <int Dim>
std::vector<Beside> materials_beside(std::span<const CellId> cells, const MeshComponents<Dim>& components,
                                     const Patch<Dim>& patch) {
  std::vector<Beside> result;
  for (const CellId c : cells)
    for (int corner = 0; corner <= Dim; ++corner) {
      const CellId next = patch.neighbour(c, corner);
      if (next == Patch<Dim>::kNoCell || patch.material(next) == patch.material(c)) continue;
      const std::uint32_t component = components.of(0, next);
      auto at = std::ranges::find(result, patch.material(next), &Beside::material);
      if (at == result.end()) at = result.insert(at, {patch.material(next), component});
      at->several |= at->component != component;
      ++at->facets;
    }
  std::ranges::sort(result, {}, [](const Beside& b) { return std::tuple(b.several, -b.facets, b.material); });
  return result;
}

}  // namespace

template <int Dim>
std::vector<Stray> find_strays(const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                               const MeshComponents<Dim>& components, const Execution& execution) {
  using Found = std::vector<std::pair<std::uint32_t, CellId>>;  // component and cell
  const CellBlock& block = mesh.blocks[0];
  const auto tasks = static_cast<std::size_t>(block_count(block.size(), kCellsPerTask));
  std::vector<Found> found(tasks);
  parallel_for(execution, static_cast<std::int64_t>(tasks), 1, [&](std::int64_t task) {
    const std::int64_t begin = task * kCellsPerTask, end = std::min(block.size(), begin + kCellsPerTask);
    for (std::int64_t c = begin; c < end; ++c) {
      const VertexId* v = block.cell(c);
      if (std::any_of(v, v + Dim + 1, [&](VertexId i) { return components.border()[i] == 0; })) continue;
      // Vertices inside come before cells, and the smallest member names a component.
      const std::uint32_t component = components.of(0, c);
      if (component >= mesh.points.size())
        found[static_cast<std::size_t>(task)].push_back({component, static_cast<CellId>(c)});
    }
  });
  Found all;
  for (const Found& f : found) all.insert(all.end(), f.begin(), f.end());
  std::ranges::sort(all);
  std::vector<Stray> strays;
  for (std::size_t i = 0; i < all.size();) {
    Stray stray;
    const std::uint32_t component = all[i].first;
    for (; i < all.size() && all[i].first == component; ++i) stray.cells.push_back(all[i].second);
    if (!holds_a_voxel<Dim>(image, mesh, stray.cells)) strays.push_back(std::move(stray));
  }
  return strays;
}

template <int Dim>
std::vector<CellId> relabel_strays(const std::vector<Stray>& strays, const MeshComponents<Dim>& components,
                                   Patch<Dim>& patch, Unpincher<Dim>& unpincher) {
  std::vector<CellId> changed;
  std::vector<VertexId> around;
  for (const Stray& stray : strays) {
    const MaterialId own = patch.material(stray.cells[0]);
    if (std::ranges::any_of(stray.cells, [&](CellId c) { return patch.material(c) != own; })) continue;
    around.clear();
    for (const CellId c : stray.cells) {
      const SimplexVertices<Dim> v = patch.cell(c);
      around.insert(around.end(), v.begin(), v.end());
    }
    std::ranges::sort(around);
    around.erase(std::ranges::unique(around).begin(), around.end());
    const auto excess = [&] {
      int sum = 0;
      for (const VertexId v : around) sum += unpincher.excess(v);
      return sum;
    };
    const int before = excess();
    for (const Beside& beside : materials_beside<Dim>(stray.cells, components, patch)) {
      for (const CellId c : stray.cells) patch.relabel(c, beside.material);
      if (excess() <= before) {
        changed.insert(changed.end(), stray.cells.begin(), stray.cells.end());
        break;
      }
      for (const CellId c : stray.cells) patch.relabel(c, own);
    }
  }
  return changed;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                \
  template std::vector<Stray> find_strays(const LabelImage<DIM>&, const Mesh<DIM>&, const MeshComponents<DIM>&,   \
                                          const Execution&);                                                      \
  template std::vector<CellId> relabel_strays(const std::vector<Stray>&, const MeshComponents<DIM>&, Patch<DIM>&, \
                                              Unpincher<DIM>&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
