#include "treemarch/improve/bridge.h"

#include <algorithm>
#include <array>
#include <functional>
#include <queue>
#include <tuple>
#include <unordered_map>

#include "treemarch/core/parallel.h"
#include "treemarch/improve/unpinch.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;

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

/// Whether a cell can be taken from its material without cutting that in two, as far as can be seen from nearby.
template <int Dim>
bool can_go(const Patch<Dim>& patch, const BrokenComponents<Dim>& broken, CellId c) {
  return patch.material(c) == broken.left_out ||
         (std::ranges::all_of(patch.cell(c), [&](VertexId v) { return patch.has_star(v); }) &&
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
    if (patch_.material(c) == material_) return group_of(c) == kNoGroup ? 2 : 0;
    const LabelImage<Dim>& image = *broken_.image;
    const Coord<Dim> voxel = image.voxel_at(patch_.centroid(c));
    const bool inside = broken_.map->of(linear_index(voxel, image.extent)) == component_;
    return inside ? 1 : 4;
  }

  bool join_from(const typename BrokenComponents<Dim>::Part& part) {
    const auto own =
        std::ranges::lower_bound(group_, part.mesh_component, {}, &std::pair<std::uint32_t, std::uint32_t>::first)
            ->second;
    std::priority_queue<Step, std::vector<Step>, std::greater<>> open;
    std::unordered_map<CellId, CellId> from;  // looked up only
    open.push({0, part.seed, part.seed});
    while (!open.empty()) {
      const Step at = open.top();
      open.pop();
      if (!from.emplace(at.cell, at.from).second) continue;
      const std::uint32_t group = group_of(at.cell);
      if (group != kNoGroup && group != own) {
        take_way(at.cell, own, from);
        for (auto& g : group_)
          if (g.second == own) g.second = group;
        return true;
      }
      for (int corner = 0; corner <= Dim; ++corner) {
        const CellId next = patch_.neighbour(at.cell, corner);
        if (next != Patch<Dim>::kNoCell && !from.contains(next)) open.push({at.cost + cost_of(next), next, at.cell});
      }
    }
    return false;
  }

  void take_way(CellId end, std::uint32_t own, const std::unordered_map<CellId, CellId>& from) {
    for (CellId c = end; from.at(c) != c; c = from.at(c)) {
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

}  // namespace

template <int Dim>
BrokenComponents<Dim> find_broken(const LabelImage<Dim>& image, const ComponentMap& map,
                                  std::span<const std::uint8_t> required, const Mesh<Dim>& mesh,
                                  const MeshComponents<Dim>& components, std::span<const ComponentFate> fates,
                                  MaterialId left_out, const Execution& execution) {
  using Broken = BrokenComponents<Dim>;
  Broken broken;
  broken.components = &components;
  broken.map = &map;
  broken.image = &image;
  broken.left_out = left_out;
  const auto is_lost = [&](std::uint32_t c) { return required[c] && fates[c].lost(); };
  const auto is_split = [&](std::uint32_t c) { return required[c] && fates[c].split(); };
  bool any_lost = false, any_split = false;
  std::vector<std::uint8_t> splits(image.labels.size(), 0);  // a component of the material is split
  for (std::uint32_t c = 0; c < fates.size(); ++c) {
    any_lost |= is_lost(c);
    any_split |= is_split(c);
    if (is_split(c)) splits[map.components[c].material] = 1;
  }
  if (!any_lost && !any_split) return broken;

  const CellBlock& block = mesh.blocks[0];
  const auto tasks = static_cast<std::size_t>(block_count(block.size(), kCellsPerTask));
  std::vector<std::vector<typename Broken::Part>> parts(tasks);
  std::vector<std::vector<typename Broken::Lost>> lost(tasks);
  const VoxelCentres<Dim> centres(image);
  const Marks concerned = map.voxels_of([&](std::uint32_t c) { return is_lost(c) || is_split(c); });
  const auto for_cells = [&](std::size_t task, auto&& f) {
    const auto begin = static_cast<std::int64_t>(task) * kCellsPerTask;
    for (std::int64_t c = begin; c < std::min(block.size(), begin + kCellsPerTask); ++c) f(static_cast<CellId>(c));
  };
  parallel_for(execution, static_cast<std::int64_t>(tasks), 1, [&](std::int64_t task) {
    auto& found = parts[static_cast<std::size_t>(task)];
    for_cells(static_cast<std::size_t>(task), [&](CellId cell) {
      const MaterialId material = block.materials[cell];
      if (!any_lost && splits[material] == 0) return;
      for_each_simplex(mesh, block, cell, [&](const Simplex<Dim>& simplex) {
        centres.visit(
            simplex,
            [&](std::int64_t v) {
              return concerned[static_cast<std::size_t>(v)] && (image.voxels[v] == material || is_lost(map.of(v)));
            },
            [&](std::int64_t v) {
              const std::uint32_t c = map.of(v);
              if (is_lost(c))
                lost[static_cast<std::size_t>(task)].push_back({c, v, cell});
              else if (const std::uint32_t own = components.of(0, cell);
                       !found.empty() && found.back().image_component == c && found.back().mesh_component == own)
                ++found.back().hits;  // not an entry a voxel: coarse cells hold thousands
              else
                found.push_back({c, own, 1, cell});
            });
      });
    });
    merge_parts(found);
  });
  broken.parts = join(parts);
  merge_parts(broken.parts);
  std::ranges::stable_sort(broken.parts, {}, [](const auto& p) { return std::tuple(p.image_component, -p.hits); });
  broken.lost = join(lost);
  std::ranges::sort(broken.lost, {}, [](const auto& l) { return std::tuple(l.image_component, l.voxel, l.cell); });

  std::vector<std::uint32_t> small;  // components of the mesh
  for (std::size_t i = 1; i < broken.parts.size(); ++i)
    if (broken.parts[i].image_component == broken.parts[i - 1].image_component)
      small.push_back(broken.parts[i].mesh_component);
  std::ranges::sort(small);
  std::vector<std::vector<CellId>> cells(tasks);
  parallel_for(execution, static_cast<std::int64_t>(small.empty() ? 0 : tasks), 1, [&](std::int64_t task) {
    for_cells(static_cast<std::size_t>(task), [&](CellId cell) {
      if (splits[block.materials[cell]] != 0 && std::ranges::binary_search(small, components.of(0, cell)))
        cells[static_cast<std::size_t>(task)].push_back(cell);
    });
  });
  broken.cells = join(cells);
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
      const MeshComponents<DIM>&, std::span<const ComponentFate>, MaterialId, const Execution&);    \
  template Mended mend_components(Patch<DIM>&, const BrokenComponents<DIM>&, RepairReport&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
