#include "treemarch/improve/repair_topology.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/improve/bridge.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/strays.h"
#include "treemarch/improve/unpinch.h"
#include "treemarch/topology/component_fates.h"

namespace treemarch {
namespace {

constexpr int kRingsOfPinches = 2;  // a move at a vertex changes the links one ring further
constexpr int kRingsOfParts = 8;    // cells across the widest gap that is bridged
constexpr std::int64_t kCellsPerTask = 1 << 14;

/// Adds the neighbours of marked vertices, some rings of them.
template <int Dim>
void grow(const CellBlock& block, std::vector<std::uint8_t>& marked, int rings, const Execution& execution) {
  for (int ring = 1; ring <= rings; ++ring) {
    const auto now = static_cast<std::uint8_t>(ring + 1);
    parallel_for(execution, block.size(), kCellsPerTask, [&](std::int64_t c) {
      const VertexId* v = block.cell(c);
      bool any = false;
      for (int k = 0; k <= Dim; ++k) {
        const std::uint8_t m = std::atomic_ref(marked[v[k]]).load(std::memory_order_relaxed);
        any |= m != 0 && m < now;
      }
      if (!any) return;
      for (int k = 0; k <= Dim; ++k) {
        const std::atomic_ref<std::uint8_t> m(marked[v[k]]);
        if (m.load(std::memory_order_relaxed) == 0) m.store(now, std::memory_order_relaxed);
      }
    });
  }
}

std::vector<VertexId> listed(const std::vector<std::uint8_t>& marked) {
  std::vector<VertexId> vertices;
  for (std::size_t v = 0; v < marked.size(); ++v)
    if (marked[v] != 0) vertices.push_back(static_cast<VertexId>(v));
  return vertices;
}

template <int Dim>
class Repairer {
 public:
  Repairer(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const RepairOptions& options, Execution& execution)
      : mesh_(mesh), image_(image), options_(options), execution_(execution), map_(map_components(image)) {
    to_image_.resize(image.labels.size());
    std::iota(to_image_.begin(), to_image_.end(), 0U);
    mark_required();
  }

  RepairReport run() {
    while (true) {
      const MeshComponents<Dim> components(mesh_, execution_);
      const std::vector<MeshPinch>& pinches = components.pinches();
      std::int64_t sheets = 0;
      for (const MeshPinch& p : pinches) sheets += p.sheets;
      if (report_.rounds == 0) report_.pinches_before = sheets;
      report_.pinches_after = sheets;
      const BrokenComponents<Dim> broken =
          find_broken(image_, map_, required_, mesh_, components,
                      component_fates(image_, map_, mesh_, components, to_image_, execution_), execution_);
      SmallPieces small = find_small_pieces<Dim>(image_, map_, required_, mesh_, components, execution_);
      report_.anchors = std::move(small.anchors);
      if ((pinches.empty() && broken.empty() && small.strays.empty()) || report_.rounds == options_.rounds)
        return report_;
      ++report_.rounds;
      if (!mend(broken, pinches, small.strays, components)) return report_;
    }
  }

 private:
  /// Components of some size, and the largest of every label.
  void mark_required() {
    required_.assign(map_.components.size(), 0);
    std::vector<std::int64_t> largest(image_.labels.size(), -1);
    for (std::size_t c = 0; c < required_.size(); ++c) {
      const ImageComponent& component = map_.components[c];
      if (component.material == options_.left_out) continue;
      required_[c] = component.voxels >= options_.min_component;
      std::int64_t& best = largest[component.material];
      if (best < 0 || map_.components[static_cast<std::size_t>(best)].voxels < component.voxels)
        best = static_cast<std::int64_t>(c);
    }
    for (const std::int64_t c : largest)
      if (c >= 0) required_[static_cast<std::size_t>(c)] = 1;
  }

  /// \return whether to look again: what is done to pinches disconnects nothing, a way that joins two parts may.
  bool mend(const BrokenComponents<Dim>& broken, const std::vector<MeshPinch>& pinches,
            const std::vector<Stray>& strays, const MeshComponents<Dim>& components) {
    const CellBlock& block = mesh_.blocks[0];
    std::vector<std::uint8_t> marked(mesh_.points.size());
    for (const std::uint32_t c : broken.cells)
      for (int k = 0; k <= Dim; ++k) marked[block.cell(c)[k]] = 1;
    if (!broken.cells.empty()) grow<Dim>(block, marked, kRingsOfParts - kRingsOfPinches, execution_);
    std::vector<VertexId> pinched;
    for (const MeshPinch& p : pinches) {
      marked[p.vertex] = 1;
      if (pinched.empty() || pinched.back() != p.vertex) pinched.push_back(p.vertex);
    }
    for (const Stray& s : strays)
      for (const CellId c : s.cells)
        for (int k = 0; k <= Dim; ++k) marked[block.cell(c)[k]] = 1;
    for (std::uint8_t& m : marked) m = m != 0;
    grow<Dim>(block, marked, kRingsOfPinches, execution_);
    Patch<Dim> patch(mesh_, listed(marked), execution_);
    Mended mended = mend_components(patch, broken, report_);
    Unpincher<Dim> unpincher(patch, mesh_, image_);
    const std::vector<CellId> given_away = relabel_strays(strays, components, patch, unpincher);
    mended.relabelled.insert(mended.relabelled.end(), given_away.begin(), given_away.end());
    for (const CellId c : mended.relabelled) {
      const auto cell = patch.cell(c);
      pinched.insert(pinched.end(), cell.begin(), cell.end());
    }
    std::ranges::sort(pinched);
    pinched.erase(std::ranges::unique(pinched).begin(), pinched.end());
    std::erase_if(pinched, [&](VertexId v) { return !patch.has_star(v); });
    unpincher.run(std::move(pinched));
    report_.pinches_after = unpincher.left();
    const std::int64_t relabelled = unpincher.relabelled() + std::ssize(mended.relabelled);
    report_.relabelled_cells += relabelled;
    return relabelled > 0 && !mended.surely_whole;
  }

  Mesh<Dim>& mesh_;
  const LabelImage<Dim>& image_;
  const RepairOptions& options_;
  Execution& execution_;
  const ComponentMap map_;
  std::vector<MaterialId> to_image_;
  std::vector<std::uint8_t> required_;  // one a component of the image
  RepairReport report_;
};

}  // namespace

template <int Dim>
RepairReport repair_topology(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const RepairOptions& options,
                             Execution& execution) {
  if (mesh.blocks.empty() || mesh.blocks[0].type != kSimplex<Dim>) return {};
  return Repairer<Dim>(mesh, image, options, execution).run();
}

template RepairReport repair_topology(Mesh<2>&, const LabelImage<2>&, const RepairOptions&, Execution&);
template RepairReport repair_topology(Mesh<3>&, const LabelImage<3>&, const RepairOptions&, Execution&);

}  // namespace treemarch
