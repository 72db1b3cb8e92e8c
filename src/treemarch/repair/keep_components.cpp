#include "treemarch/repair/keep_components.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"
#include "treemarch/repair/parts_of_components.h"
#include "treemarch/topology/block_components.h"
#include "treemarch/topology/marked_blocks.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 256;
constexpr double kReach = 2;            // voxels around a cell
constexpr std::int64_t kFewCells = 64;  // that a small component would fill if all cells were as large

/// The voxels within kReach voxels of the box around a cell.
template <int Dim>
VoxelBox<Dim> voxels_near(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const VertexId* cell, int corners) {
  constexpr double kTouch = 1e-9;  // voxels that only touch are not near
  Vec<Dim> low = mesh.points[cell[0]], high = low, voxels_per_length;
  for (int d = 0; d < Dim; ++d) {
    voxels_per_length[d] = 1 / image.frame.spacing[d];
    for (int k = 1; k < corners; ++k) {
      low[d] = std::min(low[d], mesh.points[cell[k]][d]);
      high[d] = std::max(high[d], mesh.points[cell[k]][d]);
    }
  }
  return centres_between(low, high, voxels_per_length, image.extent, kReach + 0.5 - kTouch);
}

/// Adds a voxel, and those of its material around it that belong to other components of the image.
template <int Dim>
void add_with_neighbours(const LabelImage<Dim>& image, const ComponentMap& map, std::int64_t voxel,
                         std::vector<std::int64_t>& found) {
  found.push_back(voxel);
  const Coord<Dim> at = coord_of(voxel, image.extent);
  VoxelBox<Dim> around;
  for (int d = 0; d < Dim; ++d) {
    around.begin[d] = std::max(0, at[d] - 1);
    around.end[d] = std::min(image.extent[d], at[d] + 2);
  }
  const std::uint32_t component = map.of(voxel);
  for_each_row(around, image.extent, [&](const Coord<Dim>& c, std::int64_t first) {
    for (std::int64_t v = first; v < first + around.end[0] - c[0]; ++v)
      if (image.voxels[v] == image.voxels[voxel] && map.of(v) != component) found.push_back(v);
  });
}

/// Marks the components that are in the mesh and of the materials of some cells.
template <int Dim>
std::vector<std::uint8_t> with_material_of(std::span<const CellPlace> cells, const Mesh<Dim>& mesh,
                                           const ComponentMap& map, const ComponentFates& fates) {
  std::vector<std::uint8_t> has_cell(mesh.labels.size()), marks(map.components.size());
  for (const CellPlace& c : cells) has_cell[mesh.blocks[c.block].materials[static_cast<std::size_t>(c.cell)]] = 1;
  for (std::size_t c = 0; c < marks.size(); ++c)
    marks[c] = fates.of[c].lost() ? 0 : has_cell[map.components[c].material];
  return marks;
}

/// A voxel in a cell of its material.
struct Hit {
  std::uint32_t component;  // of the image
  double depth;
  std::int64_t voxel;
  CellId cell;
};

}  // namespace

template <int Dim>
std::vector<HeldAnchor> keep_small(const LabelImage<Dim>& image, const ComponentMap& map,
                                   std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                                   const Execution& execution) {
  const std::int64_t few_voxels = kFewCells * product(image.extent) / std::max<std::int64_t>(1, mesh.cell_count());
  std::vector<std::uint8_t> small(required.begin(), required.end()), has_small(image.labels.size());
  for (std::size_t c = 0; c < small.size(); ++c) {
    if (map.components[c].voxels > few_voxels) small[c] = 0;
    has_small[map.components[c].material] |= small[c];
  }
  const Marks voxels = map.voxels_of([&](std::uint32_t c) { return small[c] != 0; });
  const VoxelCentres<Dim> centres(image);
  const CellBlock& block = mesh.blocks[0];
  const auto look = [&](std::int64_t cell, std::vector<Hit>& hits) {
    const MaterialId material = block.materials[static_cast<std::size_t>(cell)];
    if (has_small[material] == 0) return;
    for_each_simplex(mesh, block, cell, [&](const Simplex<Dim>& simplex) {
      centres.visit(
          simplex, [&](std::int64_t v) { return voxels[static_cast<std::size_t>(v)] && image.voxels[v] == material; },
          [&](std::int64_t v) {
            const double depth = Barycentric<Dim>(simplex).depth(image.centre(coord_of(v, image.extent)));
            hits.push_back({map.of(v), depth, v, static_cast<CellId>(cell)});
          });
    });
  };
  const MarkedBlocks<Dim> where(image, map, small, execution);
  std::vector<std::vector<Hit>> found(static_cast<std::size_t>(block_count(block.size(), kCellsPerGroup)));
  parallel_for(execution, std::ssize(found), kGroupsPerTask, [&](std::int64_t group) {
    const std::int64_t begin = group * kCellsPerGroup, end = std::min(block.size(), begin + kCellsPerGroup);
    const auto materials = block.materials.begin();
    if (std::none_of(materials + begin, materials + end, [&](MaterialId m) { return has_small[m] != 0; }) ||
        !where.touch(mesh, block, begin, end))
      return;
    for (std::int64_t c = begin; c < end; ++c) look(c, found[static_cast<std::size_t>(group)]);
  });
  std::vector<Hit> hits;
  for (const auto& some : found) hits.insert(hits.end(), some.begin(), some.end());
  std::ranges::sort(hits, {}, [](const Hit& h) { return std::tuple(h.component, -h.depth, h.voxel, h.cell); });
  std::vector<HeldAnchor> anchors;
  for (std::size_t h = 0; h < hits.size(); ++h)
    if (h == 0 || hits[h].component != hits[h - 1].component)
      anchors.push_back({hits[h].cell, anchor_at(image, hits[h].voxel)});
  return anchors;
}

template <int Dim>
std::vector<Anchor> keep_apart(const ComponentFates& fates, const BrokenComponents<Dim>& broken,
                               std::vector<CellId> changed, const Mesh<Dim>& mesh, const Execution& execution) {
  const std::vector<CellPlace>& cells = fates.elsewhere;
  if (cells.empty()) return {};
  const LabelImage<Dim>& image = *broken.image;
  const ComponentMap& map = *broken.map;
  const MeshComponents<Dim>& components = *broken.components;
  const PartsOfComponents parts(fates, broken);
  std::ranges::sort(changed);
  const BlockComponents<Dim> where(image, map, with_material_of(cells, mesh, map, fates), execution);
  std::vector<std::vector<std::int64_t>> found(static_cast<std::size_t>(block_count(std::ssize(cells), kCellsPerTask)));
  const auto look = [&](const CellPlace& place, std::vector<std::int64_t>& voxels) {
    const CellBlock& block = mesh.blocks[place.block];
    const VertexId* v = block.cell(place.cell);
    const int corners = vertex_count(block.type);
    if (std::all_of(v, v + corners, [&](VertexId x) { return components.is_inner(x); }) ||
        std::ranges::binary_search(changed, static_cast<CellId>(place.cell)))
      return;
    const MaterialId material = block.materials[static_cast<std::size_t>(place.cell)];
    const std::uint32_t part = components.of(place.block, place.cell);
    const auto is_another = [&](std::uint32_t c) { return parts.is_elsewhere(c, part); };
    const VoxelBox<Dim> box = voxels_near(image, mesh, v, corners);
    if (box.is_empty()) return;
    bool is_near = false;
    const VoxelBox<Dim> blocks = blocks_around(box);
    for_each_row(blocks, where.extent(), [&](const Coord<Dim>&, std::int64_t at) {
      for (std::int64_t b = at; b < at + blocks.end[0] - blocks.begin[0]; ++b)
        for (const std::uint32_t c : where[b])
          is_near = is_near || (map.components[c].material == material && is_another(c));
    });
    if (!is_near) return;
    for_each_row(box, image.extent, [&](const Coord<Dim>& c, std::int64_t first) {
      bool is_other = false;  // as long as the material stays, the component does
      for (std::int64_t x = first, end = first + box.end[0] - c[0]; x < end; ++x) {
        if (image.voxels[x] != material) continue;
        if (x == first || image.voxels[x - 1] != material) is_other = is_another(map.of(x));
        if (is_other) add_with_neighbours(image, map, x, voxels);
      }
    });
  };
  parallel_for(execution, std::ssize(found), 1, [&](std::int64_t task) {
    std::vector<std::int64_t>& voxels = found[static_cast<std::size_t>(task)];
    for (std::int64_t i = task * kCellsPerTask; i < std::min(std::ssize(cells), (task + 1) * kCellsPerTask); ++i)
      look(cells[static_cast<std::size_t>(i)], voxels);
    std::ranges::sort(voxels);
    voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
  });
  std::vector<std::int64_t> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  std::ranges::sort(all);
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::vector<Anchor> anchors;
  anchors.reserve(all.size());
  for (const std::int64_t voxel : all) {
    anchors.push_back(anchor_at(image, voxel));
    anchors.back().inside = false;
  }
  return anchors;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                  \
  template std::vector<HeldAnchor> keep_small(const LabelImage<DIM>&, const ComponentMap&,                          \
                                              std::span<const std::uint8_t>, const Mesh<DIM>&, const Execution&);   \
  template std::vector<Anchor> keep_apart(const ComponentFates&, const BrokenComponents<DIM>&, std::vector<CellId>, \
                                          const Mesh<DIM>&, const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
