#include "treemarch/repair/bridge.h"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>
#include <unordered_map>

#include "treemarch/core/parallel.h"
#include "treemarch/repair/unpinch.h"
#include "treemarch/topology/marked_blocks.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

template <class T>
std::vector<T> join(const std::vector<std::vector<T>>& parts) {
  std::vector<T> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// Adds up parts that are the same.
template <class Part>
void merge_parts(std::vector<Part>& parts) {
  std::ranges::sort(parts, {}, [](const Part& p) { return std::tuple(p.image_component, p.mesh_component, p.seed); });
  std::size_t n = 0;
  for (const Part& p : parts) {
    if (n > 0 && parts[n - 1].image_component == p.image_component && parts[n - 1].mesh_component == p.mesh_component)
      parts[n - 1].hits += p.hits;
    else
      parts[n++] = p;
  }
  parts.resize(n);
}

/// Whether a cell can be taken from its material without cutting that in two, as far as can be seen from nearby, or
/// losing a component of it.
template <int Dim>
bool can_go(const Patch<Dim>& patch, const BrokenComponents<Dim>& broken, CellId c) {
  return patch.material(c) == broken.left_out ||
         (!std::ranges::binary_search(broken.kept, c) &&
          std::ranges::all_of(patch.cell(c), [&](VertexId v) { return patch.has_star(v); }) &&
          keeps_connection<Dim>(patch, std::span(&c, 1)));
}

/// Joins one part of a component to another part of it.
template <int Dim>
class Bridger {
 public:
  Bridger(Patch<Dim>& patch, const BrokenComponents<Dim>& broken) : patch_(patch), broken_(broken) {}

  /// \param parts of one component of the image, the largest first
  /// \return number of parts that were joined to another
  std::int64_t run(std::span<const typename BrokenComponents<Dim>::Part> parts) {
    component_ = parts[0].image_component;
    material_ = broken_.map->components[component_].material;
    group_.clear();
    for (const auto& p : parts) group_.push_back({p.mesh_component, p.mesh_component});
    std::ranges::sort(group_);
    taken_.clear();
    std::int64_t joined = 0;
    for (std::size_t p = parts.size(); p-- > 1;) joined += join_from(parts[p]);
    return joined;
  }
  [[nodiscard]] const std::vector<CellId>& relabelled() const { return relabelled_; }
  [[nodiscard]] bool cut_another() const { return cut_another_; }

 private:
  static constexpr std::uint32_t kNoGroup = ComponentFate::kNone;
  // Costs of a cell on a way: in voxels of the component, in another part of its material, in others' voxels, and where
  // the way would cut another component in two, whose repair might cut this one again.
  static constexpr std::int64_t kInside = 1, kForeignPart = 2, kOutsideOfIt = 4, kCut = 40;
  struct Step {
    std::int64_t cost;
    CellId cell;
    CellId from;
    auto operator<=>(const Step&) const = default;
  };

  /// The parts that a cell belongs to, which have been joined so far, or kNoGroup.
  [[nodiscard]] std::uint32_t group_of(CellId c) const {
    if (patch_.material(c) != material_) return kNoGroup;
    std::uint32_t mesh_component = broken_.components->of(0, c);
    if (const auto at = taken_.find(c); at != taken_.end()) mesh_component = at->second;
    const auto at =
        std::ranges::lower_bound(group_, mesh_component, {}, &std::pair<std::uint32_t, std::uint32_t>::first);
    return at != group_.end() && at->first == mesh_component ? at->second : kNoGroup;
  }
  [[nodiscard]] std::int64_t cost_of(CellId c) const {
    if (patch_.material(c) == material_) return group_of(c) == kNoGroup ? kForeignPart : 0;
    const LabelImage<Dim>& image = *broken_.image;
    const Coord<Dim> voxel = image.voxel_at(patch_.centroid(c));
    const bool inside = broken_.map->of(linear_index(voxel, image.extent)) == component_;
    return inside ? kInside : kOutsideOfIt;
  }

  bool join_from(const typename BrokenComponents<Dim>::Part& part) {
    const auto own =
        std::ranges::lower_bound(group_, part.mesh_component, {}, &std::pair<std::uint32_t, std::uint32_t>::first)
            ->second;
    std::vector<CellId> way = cheapest_way(part.seed, own, 0);
    if (way.empty()) return false;
    if (!std::ranges::all_of(way, [&](CellId c) { return can_take(c); })) way = cheapest_way(part.seed, own, kCut);
    const std::uint32_t other = group_of(way.front());
    take(way, own);
    for (auto& g : group_)
      if (g.second == own) g.second = other;
    return true;
  }
  [[nodiscard]] bool can_take(CellId c) const { return patch_.material(c) == material_ || can_go(patch_, broken_, c); }

  /// From a cell of another group back to the seed; empty if there is none. \param cut for each cell that would cut
  std::vector<CellId> cheapest_way(CellId seed, std::uint32_t own, std::int64_t cut) const {
    std::priority_queue<Step, std::vector<Step>, std::greater<>> open;
    std::unordered_map<CellId, CellId> from;  // looked up only
    open.push({0, seed, seed});
    while (!open.empty()) {
      const Step at = open.top();
      open.pop();
      if (!from.emplace(at.cell, at.from).second) continue;
      const std::uint32_t group = group_of(at.cell);
      if (group != kNoGroup && group != own) {
        std::vector<CellId> way{at.cell};
        while (way.back() != seed) way.push_back(from.at(way.back()));
        return way;
      }
      const std::int64_t cost = at.cost + (cut == 0 || can_take(at.cell) ? 0 : cut);
      for (int corner = 0; corner <= Dim; ++corner) {
        const CellId next = patch_.neighbour(at.cell, corner);
        if (next != Patch<Dim>::kNoCell && !from.contains(next)) open.push({cost + cost_of(next), next, at.cell});
      }
    }
    return {};
  }

  void take(std::span<const CellId> way, std::uint32_t own) {
    for (const CellId c : way) {
      if (patch_.material(c) == material_) continue;
      cut_another_ |= !can_go(patch_, broken_, c);
      patch_.relabel(c, material_);
      taken_[c] = own;
      relabelled_.push_back(c);
    }
  }

  Patch<Dim>& patch_;
  const BrokenComponents<Dim>& broken_;
  std::uint32_t component_ = 0;
  MaterialId material_ = 0;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> group_;  // of each component of the mesh, ascending
  std::unordered_map<CellId, std::uint32_t> taken_;             // cells that changed, and what they belong to now
  std::vector<CellId> relabelled_;
  bool cut_another_ = false;
};

/// How many of the voxels beside a voxel are of its component.
template <int Dim>
int neighbours_within(const BrokenComponents<Dim>& broken, std::int64_t voxel) {
  const Coord<Dim>& extent = broken.image->extent;
  const Coord<Dim> c = coord_of(voxel, extent);
  int count = 0;
  for (int d = 0; d < Dim; ++d)
    for (const int step : {-1, 1}) {
      Coord<Dim> next = c;
      next[d] += step;
      if (next[d] < 0 || next[d] >= extent[d]) continue;
      count += broken.map->of(linear_index(next, extent)) == broken.map->of(voxel);
    }
  return count;
}

/// Whether cells hang together over facets. \param cells ascending
template <int Dim>
bool are_connected(const Patch<Dim>& patch, std::span<const CellId> cells) {
  std::vector<std::uint8_t> met(cells.size());
  std::vector<std::size_t> open{0};
  met[0] = 1;
  std::size_t count = 0;
  for (; !open.empty(); ++count) {
    const CellId c = cells[open.back()];
    open.pop_back();
    for (int corner = 0; corner <= Dim; ++corner) {
      const CellId beside = patch.neighbour(c, corner);
      const auto next = std::ranges::lower_bound(cells, beside);
      const auto at = static_cast<std::size_t>(next - cells.begin());
      if (next == cells.end() || *next != beside || met[at]++ != 0) continue;
      open.push_back(at);
    }
  }
  return count == cells.size();
}

/// Gives a lost component the cells around the centre of its innermost voxel, and those of which it has half the
/// volume.
template <int Dim>
void restore(Patch<Dim>& patch, const BrokenComponents<Dim>& broken,
             std::span<const typename BrokenComponents<Dim>::Lost> lost, Mended& mended) {
  std::int64_t innermost = -1;
  int most = -1;
  for (const auto& l : lost)
    if (const int n = neighbours_within(broken, l.voxel); n > most) innermost = l.voxel, most = n;
  const double voxel = broken.image->voxel_volume();
  std::vector<std::pair<CellId, double>> share;  // of its voxels in cells
  for (const auto& l : lost) {
    std::array<Vec<Dim>, Dim> edges;
    const SimplexVertices<Dim> v = patch.cell(l.cell);
    for (int k = 0; k < Dim; ++k) edges[k] = patch.point(v[k + 1]) - patch.point(v[0]);
    const double volume = determinant<Dim>(edges) / (Dim == 2 ? 2 : 6);
    share.push_back({l.cell, l.voxel == innermost ? 1 : voxel / volume});
  }
  std::ranges::sort(share);
  const MaterialId material = broken.map->components[lost[0].image_component].material;
  std::vector<CellId> taken;
  for (std::size_t i = 0; i < share.size();) {
    const CellId cell = share[i].first;
    double sum = 0;
    for (; i < share.size() && share[i].first == cell; ++i) sum += share[i].second;
    if (sum < 0.5) continue;
    mended.surely_whole &= can_go(patch, broken, cell);
    patch.relabel(cell, material);
    taken.push_back(cell);
  }
  mended.surely_whole &= are_connected<Dim>(patch, taken);
  mended.relabelled.insert(mended.relabelled.end(), taken.begin(), taken.end());
  const auto inner = std::ranges::find(lost, innermost, &BrokenComponents<Dim>::Lost::voxel);
  mended.restored.push_back({inner->cell, anchor_at(*broken.image, innermost)});
}

/// The cells that contain voxels of lost components.
template <int Dim>
std::vector<typename BrokenComponents<Dim>::Lost> find_lost(const BrokenComponents<Dim>& broken,
                                                            std::span<const std::uint8_t> is_lost,
                                                            const Mesh<Dim>& mesh, const Execution& execution) {
  const LabelImage<Dim>& image = *broken.image;
  const ComponentMap& map = *broken.map;
  const CellBlock& block = mesh.blocks[0];
  const Marks voxels = map.voxels_of([&](std::uint32_t c) { return is_lost[c] != 0; });
  const MarkedBlocks<Dim> blocks(image, map, is_lost, execution);
  const VoxelCentres<Dim> centres(image);
  std::vector<std::vector<typename BrokenComponents<Dim>::Lost>> lost(
      static_cast<std::size_t>(block_count(block.size(), kCellsPerGroup)));
  parallel_for(execution, std::ssize(lost), kGroupsPerTask, [&](std::int64_t group) {
    const std::int64_t begin = group * kCellsPerGroup, end = std::min(block.size(), begin + kCellsPerGroup);
    if (!blocks.touch(mesh, block, begin, end)) return;
    for (std::int64_t c = begin; c < end; ++c)
      for_each_simplex(mesh, block, c, [&](const Simplex<Dim>& simplex) {
        centres.visit(
            simplex, [&](std::int64_t v) { return voxels[static_cast<std::size_t>(v)]; },
            [&](std::int64_t v) {
              lost[static_cast<std::size_t>(group)].push_back({map.of(v), v, static_cast<CellId>(c)});
            });
      });
  });
  auto all = join(lost);
  std::ranges::sort(all, {}, [](const auto& l) { return std::tuple(l.image_component, l.voxel, l.cell); });
  return all;
}

/// The parts of split components, by component of the image, the largest first.
template <int Dim>
std::vector<typename BrokenComponents<Dim>::Part> find_parts(const BrokenComponents<Dim>& broken,
                                                             std::span<const std::uint8_t> is_split,
                                                             const ComponentFates& fates, const Mesh<Dim>& mesh,
                                                             const Execution& execution) {
  using Part = typename BrokenComponents<Dim>::Part;
  const LabelImage<Dim>& image = *broken.image;
  const ComponentMap& map = *broken.map;
  const VoxelCentres<Dim> centres(image);
  const MarkedBlocks<Dim> where(image, map, is_split, execution);
  const Coord<Dim> blocks = blocks_around(VoxelBox<Dim>{{}, image.extent}).end;
  const auto n = std::ssize(fates.elsewhere);
  std::vector<std::vector<Part>> parts(static_cast<std::size_t>(block_count(n, kCellsPerGroup)));
  parallel_for(execution, std::ssize(parts), 1, [&](std::int64_t group) {
    auto& found = parts[static_cast<std::size_t>(group)];
    for (std::int64_t i = group * kCellsPerGroup; i < std::min(n, (group + 1) * kCellsPerGroup); ++i) {
      const CellPlace& place = fates.elsewhere[static_cast<std::size_t>(i)];
      const CellBlock& block = mesh.blocks[place.block];
      const MaterialId material = block.materials[static_cast<std::size_t>(place.cell)];
      const std::uint32_t own = broken.components->of(place.block, place.cell);
      for_each_simplex(mesh, block, place.cell, [&](const Simplex<Dim>& simplex) {
        centres.visit(
            simplex, blocks, [&](std::int64_t at) { return where[at] ? Look::at_all : Look::nowhere; },
            [&](std::int64_t v) { return image.voxels[v] == material && is_split[map.of(v)] != 0; },
            [&](std::int64_t v) {
              const std::uint32_t c = map.of(v);
              if (!found.empty() && found.back().image_component == c && found.back().mesh_component == own)
                ++found.back().hits;  // not an entry a voxel: coarse cells hold thousands
              else
                found.push_back({c, own, 1, static_cast<CellId>(place.cell)});
            });
      });
    }
    merge_parts(found);
  });
  std::vector<Part> all = join(parts);
  for (std::uint32_t c = 0; c < is_split.size(); ++c)
    if (is_split[c] != 0 && fates.in_main[c] != 0)
      all.push_back({c, fates.main[map.components[c].material], std::numeric_limits<std::int64_t>::max(), 0});
  merge_parts(all);
  std::ranges::stable_sort(all, {}, [](const auto& p) { return std::tuple(p.image_component, -p.hits); });
  return all;
}

/// Those of some cells that belong to some parts, which are ascending.
template <int Dim>
std::vector<CellId> cells_of(std::span<const std::uint32_t> parts, const MeshComponents<Dim>& components,
                             std::span<const CellPlace> cells, const Execution& execution) {
  std::vector<std::vector<CellId>> found(static_cast<std::size_t>(block_count(std::ssize(cells), kCellsPerGroup)));
  parallel_for(execution, std::ssize(found), kGroupsPerTask, [&](std::int64_t group) {
    const std::int64_t begin = group * kCellsPerGroup, end = std::min(std::ssize(cells), begin + kCellsPerGroup);
    for (const auto& [block, cell] : cells.subspan(begin, end - begin))
      if (std::ranges::binary_search(parts, components.of(block, cell)))
        found[static_cast<std::size_t>(group)].push_back(static_cast<CellId>(cell));
  });
  return join(found);
}

}  // namespace

template <int Dim>
BrokenComponents<Dim> find_broken(const LabelImage<Dim>& image, const ComponentMap& map,
                                  std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                                  const MeshComponents<Dim>& components, const ComponentFates& fates,
                                  MaterialId left_out, const Execution& execution) {
  BrokenComponents<Dim> broken;
  broken.components = &components;
  broken.map = &map;
  broken.image = &image;
  broken.left_out = left_out;
  std::vector<std::uint8_t> is_lost(fates.of.size()), is_split(fates.of.size());
  for (std::size_t c = 0; c < fates.of.size(); ++c) {
    is_lost[c] = required[c] != 0 && fates.of[c].lost();
    is_split[c] = required[c] != 0 && fates.of[c].split();
  }
  if (std::ranges::count(is_split, 0) < std::ssize(is_split))
    broken.parts = find_parts(broken, is_split, fates, mesh, execution);
  if (std::ranges::count(is_lost, 0) < std::ssize(is_lost)) broken.lost = find_lost(broken, is_lost, mesh, execution);

  std::vector<std::uint32_t> small;  // components of the mesh
  for (std::size_t i = 1; i < broken.parts.size(); ++i)
    if (broken.parts[i].image_component == broken.parts[i - 1].image_component)
      small.push_back(broken.parts[i].mesh_component);
  std::ranges::sort(small);
  if (!small.empty()) broken.cells = cells_of(small, components, fates.elsewhere, execution);
  for (const auto& l : broken.lost) broken.cells.push_back(l.cell);
  return broken;
}

template <int Dim>
Mended mend_components(Patch<Dim>& patch, const BrokenComponents<Dim>& broken, RepairReport& report) {
  Mended mended;
  for (std::size_t i = 0; i < broken.lost.size();) {
    std::size_t end = i;
    while (end < broken.lost.size() && broken.lost[end].image_component == broken.lost[i].image_component) ++end;
    restore<Dim>(patch, broken, std::span(broken.lost).subspan(i, end - i), mended);
    ++report.restored;
    i = end;
  }
  Bridger<Dim> bridger(patch, broken);
  for (std::size_t i = 0; i < broken.parts.size();) {
    std::size_t end = i;
    while (end < broken.parts.size() && broken.parts[end].image_component == broken.parts[i].image_component) ++end;
    const std::int64_t joined = bridger.run(std::span(broken.parts).subspan(i, end - i));
    report.bridged += joined;
    mended.surely_whole &= joined + 1 == static_cast<std::int64_t>(end - i);
    i = end;
  }
  mended.relabelled.insert(mended.relabelled.end(), bridger.relabelled().begin(), bridger.relabelled().end());
  mended.surely_whole &= !bridger.cut_another();
  return mended;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                  \
  template BrokenComponents<DIM> find_broken(                                                       \
      const LabelImage<DIM>&, const ComponentMap&, std::span<const std::uint8_t>, const Mesh<DIM>&, \
      const MeshComponents<DIM>&, const ComponentFates&, MaterialId, const Execution&);             \
  template Mended mend_components(Patch<DIM>&, const BrokenComponents<DIM>&, RepairReport&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
