#include "treemarch/repair/strays.h"

#include <algorithm>
#include <span>
#include <tuple>
#include <utility>

#include "treemarch/mesh/marks.h"
#include "treemarch/repair/unpinch.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

/// Whether some cells of one component contain the centre of a voxel of their label.
template <int Dim>
bool hold_voxels(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::span<const CellId> cells) {
  const CellBlock& block = mesh.blocks[0];
  const MaterialId material = block.materials[cells[0]];
  const VoxelCentres<Dim> centres(image);
  bool any = false;
  for (const CellId c : cells) {
    for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
      centres.visit(
          simplex, [&](std::int64_t v) { return !any && image.voxels[v] == material; },
          [&](std::int64_t) { any = true; });
    });
    if (any) return true;
  }
  return false;
}

/// Whether there are cells of their material beside some cells: a way to another part may lead over them.
template <int Dim>
bool is_joined(std::span<const CellId> cells, const Patch<Dim>& patch) {
  return std::ranges::any_of(cells, [&](CellId c) {
    for (int corner = 0; corner <= Dim; ++corner) {
      const CellId next = patch.neighbour(c, corner);
      if (next != Patch<Dim>::kNoCell && patch.material(next) == patch.material(c) &&
          std::ranges::find(cells, next) == cells.end())
        return true;
    }
    return false;
  });
}

/// A material beside some cells.
struct Beside {
  MaterialId material;
  std::uint32_t component;  // of the mesh, the first that was met
  bool several = false;     // components of it
  double area = 0;          // of the facets to it
};

template <int Dim>
std::vector<Beside> materials_beside(std::span<const CellId> cells, const MeshComponents<Dim>& components,
                                     const Patch<Dim>& patch, MaterialId left_out) {
  std::vector<Beside> result;
  for (const CellId c : cells)
    for (int corner = 0; corner <= Dim; ++corner) {
      const CellId next = patch.neighbour(c, corner);
      if (next == Patch<Dim>::kNoCell || patch.material(next) == patch.material(c)) continue;
      const MaterialId material = patch.material(next);
      const std::uint32_t component = material == left_out ? 0 : components.of(0, next);
      auto at = std::ranges::find(result, material, &Beside::material);
      if (at == result.end()) at = result.insert(at, {material, component});
      at->several |= at->component != component;
      at->area += facet_area<Dim>(patch, c, corner);
    }
  std::ranges::sort(result, {}, [](const Beside& b) { return std::tuple(b.several, -b.area, b.material); });
  return result;
}

}  // namespace

template <int Dim>
std::vector<Stray> find_strays(const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                               const MeshComponents<Dim>& components, const Execution& execution) {
  const Marks with_inner_vertex = components.with_inner_vertex(execution);
  std::vector<std::pair<std::uint32_t, CellId>> all;  // component and cell
  for (const auto& [b, cell] : components.cells_at_borders())
    if (const std::uint32_t component = components.of(b, cell); b == 0 && !with_inner_vertex[component])
      all.emplace_back(component, static_cast<CellId>(cell));
  std::ranges::sort(all);
  std::vector<Stray> strays;
  for (std::size_t i = 0; i < all.size();) {
    Stray piece;
    const std::uint32_t component = all[i].first;
    for (; i < all.size() && all[i].first == component; ++i) piece.cells.push_back(all[i].second);
    if (!hold_voxels<Dim>(image, mesh, piece.cells)) strays.push_back(std::move(piece));
  }
  return strays;
}

template <int Dim>
std::vector<CellId> relabel_strays(const std::vector<Stray>& strays, const MeshComponents<Dim>& components,
                                   MaterialId left_out, Patch<Dim>& patch) {
  PinchCounter<Dim> counter(patch);
  std::vector<CellId> changed;
  std::vector<VertexId> around;
  for (const Stray& stray : strays) {
    const MaterialId own = patch.material(stray.cells[0]);
    if (std::ranges::any_of(stray.cells, [&](CellId c) { return patch.material(c) != own; }) ||
        is_joined<Dim>(stray.cells, patch))
      continue;
    around.clear();
    for (const CellId c : stray.cells) {
      const SimplexVertices<Dim> v = patch.cell(c);
      around.insert(around.end(), v.begin(), v.end());
    }
    std::ranges::sort(around);
    around.erase(std::unique(around.begin(), around.end()), around.end());
    const auto excess = [&] {
      int sum = 0;
      for (const VertexId v : around) sum += counter.excess(v);
      return sum;
    };
    const int before = excess();
    for (const Beside& beside : materials_beside<Dim>(stray.cells, components, patch, left_out)) {
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

#define TREEMARCH_INSTANTIATE(DIM)                                                                               \
  template std::vector<Stray> find_strays(const LabelImage<DIM>&, const Mesh<DIM>&, const MeshComponents<DIM>&,  \
                                          const Execution&);                                                     \
  template std::vector<CellId> relabel_strays(const std::vector<Stray>&, const MeshComponents<DIM>&, MaterialId, \
                                              Patch<DIM>&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
