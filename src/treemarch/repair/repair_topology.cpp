#include "treemarch/repair/repair_topology.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/improve/patch.h"
#include "treemarch/mesh/marks.h"
#include "treemarch/repair/bridge.h"
#include "treemarch/repair/keep_components.h"
#include "treemarch/repair/neighbourhood.h"
#include "treemarch/repair/parts_of_components.h"
#include "treemarch/repair/strays.h"
#include "treemarch/repair/unpinch.h"
#include "treemarch/topology/component_fates.h"
#include "treemarch/topology/marked_blocks.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

// In lengths of the longest edge of a cell.
constexpr double kReachOfPinches = 1;  // a move at a vertex changes the links one ring further
constexpr double kReachOfParts = 4;    // the widest gap that is bridged

constexpr std::int64_t kFacetsPerTask = 1 << 14;

template <int Dim>
class Repairer {
 public:
  Repairer(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const RepairOptions& options, LeftOutCells<Dim>* left_out,
           Execution& execution)
      : mesh_(mesh),
        image_(image),
        options_(options),
        left_out_(left_out),
        execution_(execution),
        map_(map_components(image, execution)),
        uniform_(image, execution) {
    to_image_.resize(image.labels.size());
    std::iota(to_image_.begin(), to_image_.end(), 0U);
    if (options.left_out != kOutside) to_image_[options.left_out] = kOutside;
    mark_required();
  }

  RepairReport run() {
    while (true) {
      // After the first round a uniform cell may have got another neighbour.
      const KnownOfMesh<Dim> known =
          report_.rounds == 0 ? KnownOfMesh<Dim>{image_.size(), options_.uniform_cells, options_.at_interfaces}
                              : KnownOfMesh<Dim>{image_.size()};
      const MeshComponents<Dim> components(mesh_, execution_, known);
      const std::vector<MeshPinch>& pinches = components.pinches();
      std::int64_t sheets = 0;
      for (const MeshPinch& p : pinches) sheets += p.sheets;
      if (report_.rounds == 0) report_.pinches_before = sheets;
      report_.pinches_after = sheets;
      const PlainBlocks<Dim> plain = needs_plain_blocks(image_, mesh_)
                                         ? PlainBlocks<Dim>(image_, uniform_, mesh_, components.facets(), execution_)
                                         : PlainBlocks<Dim>(uniform_);
      const ComponentFates fates = component_fates(image_, map_, mesh_, components, plain, to_image_, execution_);
      add_cells_of_lost(fates.of);
      BrokenComponents<Dim> broken =
          find_broken(image_, map_, required_, mesh_, components, fates, options_.left_out, execution_);
      const std::vector<Stray> strays = find_strays(image_, mesh_, components, execution_);
      const std::vector<HeldAnchor> small = keep_small<Dim>(image_, map_, required_, mesh_, execution_);
      for (const HeldAnchor& s : small) broken.kept.push_back(s.cell);
      std::ranges::sort(broken.kept);
      changed_.clear();
      const bool sound = pinches.empty() && broken.empty() && strays.empty();
      if (!sound && report_.rounds < options_.rounds) {
        ++report_.rounds;
        if (mend(broken, strays, components, fates)) continue;
      }
      report_.anchors = keep_apart<Dim>(fates, broken, changed_, mesh_, execution_);
      restored_.insert(restored_.end(), small.begin(), small.end());
      for (const HeldAnchor& held : restored_) report_.anchors.push_back(held.anchor);
      std::ranges::sort(report_.anchors, {}, &Anchor::point);
      return report_;
    }
  }

 private:
  /// Components of some size, and the largest of every label.
  void mark_required() {
    required_.assign(map_.components.size(), 0);
    const std::vector<std::int64_t> largest = largest_components(map_.components, image_.labels.size());
    for (std::size_t c = 0; c < required_.size(); ++c) {
      const ImageComponent& component = map_.components[c];
      if (component.material == options_.left_out) continue;
      required_[c] =
          component.voxels >= options_.min_component || largest[component.material] == static_cast<std::int64_t>(c);
    }
  }

  /// Adds the cells that were left out and contain voxels of a lost component.
  void add_cells_of_lost(const std::vector<ComponentFate>& fates) {
    std::vector<std::uint8_t> is_lost(fates.size());
    for (std::size_t c = 0; c < fates.size(); ++c) is_lost[c] = required_[c] != 0 && fates[c].lost();
    if (left_out_ == nullptr || std::ranges::count(is_lost, 0) == std::ssize(is_lost)) return;
    const Marks lost = map_.voxels_of([&](std::uint32_t c) { return is_lost[c] != 0; });
    const VoxelCentres<Dim> centres(image_);
    const MarkedBlocks<Dim> where(image_, map_, is_lost, execution_);
    left_out_->append_if(
        mesh_,
        [&](const SimplexVertices<Dim>& v) {
          Simplex<Dim> simplex;
          for (int k = 0; k <= Dim; ++k) simplex[k] = mesh_.points[v[k]];
          bool contains = false;
          centres.visit(
              simplex, uniform_.extent(),
              [&](std::int64_t block) { return where[block] ? Look::at_all : Look::nowhere; },
              [&](std::int64_t voxel) { return lost[static_cast<std::size_t>(voxel)]; },
              [&](std::int64_t) { contains = true; });
          return contains;
        },
        execution_);
  }

  /// The vertices that may have to do with the breaches.
  Marks around(const BrokenComponents<Dim>& broken, const std::vector<Stray>& strays,
               const MeshComponents<Dim>& components, const Marks& at_pinch) const {
    std::vector<Reach> cells;
    for (const CellId c : broken.cells) {
      const auto v = mesh_.blocks[0].cell(c);
      // Ways to other parts begin at a border.
      if (!std::all_of(v, v + Dim + 1, [&](VertexId x) { return components.is_inner(x); }))
        cells.push_back({c, kReachOfParts});
    }
    for (const Stray& s : strays)
      for (const CellId c : s.cells) cells.push_back({c, kReachOfPinches});
    const auto& facets = components.facets();
    std::vector<std::vector<Reach>> pinched(static_cast<std::size_t>(block_count(std::ssize(facets), kFacetsPerTask)));
    parallel_for(execution_, std::ssize(pinched), 1, [&](std::int64_t task) {
      const std::int64_t begin = task * kFacetsPerTask, end = std::min(std::ssize(facets), begin + kFacetsPerTask);
      for (std::int64_t i = begin; i < end; ++i) {
        const auto c = static_cast<CellId>(facets[static_cast<std::size_t>(i)].side.cell);
        const VertexId* v = mesh_.blocks[0].cell(c);
        if (std::any_of(v, v + Dim + 1, [&](VertexId x) { return at_pinch[x]; }))
          pinched[static_cast<std::size_t>(task)].push_back({c, kReachOfPinches});
      }
    });
    for (const auto& in_task : pinched) cells.insert(cells.end(), in_task.begin(), in_task.end());
    Marks marked(mesh_.points.size());
    mark_near<Dim>(mesh_, cells, image_, marked, execution_);
    return marked;
  }

  /// \return whether to look again: a way that joins two parts may disconnect others, and moves at pinches may lead to
  /// the rim of what is worked on.
  bool mend(const BrokenComponents<Dim>& broken, const std::vector<Stray>& strays,
            const MeshComponents<Dim>& components, const ComponentFates& fates) {
    Marks at_pinch(mesh_.points.size());
    for (const MeshPinch& p : components.pinches()) at_pinch.mark(p.vertex);
    std::vector<VertexId> pinched = at_pinch.vertices();
    const Marks chosen = around(broken, strays, components, at_pinch);
    if (left_out_ != nullptr) left_out_->append_at(mesh_, chosen, execution_);
    Patch<Dim> patch(mesh_, chosen.vertices(), execution_);
    Mended mended = mend_components(patch, broken, report_);
    const std::vector<CellId> given_away = relabel_strays(strays, components, options_.left_out, patch);
    mended.relabelled.insert(mended.relabelled.end(), given_away.begin(), given_away.end());
    for (const CellId c : mended.relabelled) {
      const auto cell = patch.cell(c);
      pinched.insert(pinched.end(), cell.begin(), cell.end());
    }
    std::ranges::sort(pinched);
    pinched.erase(std::unique(pinched.begin(), pinched.end()), pinched.end());
    std::erase_if(pinched, [&](VertexId v) { return !patch.has_star(v); });
    std::vector<CellId> kept = broken.kept;
    for (const HeldAnchor& r : mended.restored) kept.push_back(r.cell);
    std::ranges::sort(kept);
    const UnpinchReport unpinched = unpinch(patch, mesh_, image_, std::move(pinched), kept, execution_);
    report_.pinches_after = unpinched.left;
    changed_ = mended.relabelled;
    changed_.insert(changed_.end(), unpinched.relabelled.begin(), unpinched.relabelled.end());
    report_.relabelled_cells += std::ssize(changed_);
    for (const HeldAnchor& r : mended.restored) mended.surely_whole &= patch.material(r.cell) == r.anchor.material;
    restored_.insert(restored_.end(), mended.restored.begin(), mended.restored.end());
    std::ranges::sort(changed_);
    mended.surely_whole = mended.surely_whole && !took_another(patch, broken, fates);
    if (!unpinched.confined && (changed_.empty() || mended.surely_whole)) return false;
    Marks changed(mesh_.points.size());
    for (const CellId c : mended.relabelled)
      for (const VertexId v : patch.cell(c)) changed.mark(v);
    if (left_out_ != nullptr)
      left_out_->append_at(mesh_, changed, execution_);  // ways may lead to the rim of the patch
    return true;
  }

  /// Whether a cell with another material than before came to hold a voxel of a component that, as far as can be seen
  /// from nearby, lies in another part of that material.
  bool took_another(const Patch<Dim>& patch, const BrokenComponents<Dim>& broken, const ComponentFates& fates) const {
    const PartsOfComponents parts(fates, broken);
    const VoxelCentres<Dim> centres(image_);
    // What changed cells belonged to says nothing: the way leads over them.
    std::vector<CellId> way;
    const auto is_beside = [&](CellId c, std::uint32_t component) {
      way.assign(1, c);
      for (std::size_t i = 0; i < way.size(); ++i)
        for (int corner = 0; corner <= Dim; ++corner) {
          const CellId next = patch.neighbour(way[i], corner);
          if (next == Patch<Dim>::kNoCell || patch.material(next) != patch.material(c)) continue;
          const std::uint32_t part = broken.components->of(0, next);
          const bool is_changed = std::ranges::binary_search(changed_, next);
          if (!is_changed && !parts.is_elsewhere(component, part)) return true;
          if (is_changed && std::ranges::find(way, next) == way.end()) way.push_back(next);
        }
      return false;
    };
    return std::ranges::any_of(changed_, [&](CellId c) {
      Simplex<Dim> simplex;
      for (int k = 0; k <= Dim; ++k) simplex[k] = patch.point(patch.cell(c)[k]);
      bool another = false;
      centres.visit(
          simplex, [&](std::int64_t voxel) { return image_.voxels[voxel] == patch.material(c); },
          [&](std::int64_t voxel) {
            const std::uint32_t component = map_.of(voxel);
            another = another || (required_[component] != 0 && !fates.of[component].lost() && !is_beside(c, component));
          });
      return another;
    });
  }

  Mesh<Dim>& mesh_;
  const LabelImage<Dim>& image_;
  const RepairOptions& options_;
  LeftOutCells<Dim>* const left_out_;
  Execution& execution_;
  const ComponentMap map_;
  const UniformBlocks<Dim> uniform_;
  std::vector<MaterialId> to_image_;
  std::vector<std::uint8_t> required_;  // one a component of the image
  std::vector<HeldAnchor> restored_;    // of the components that were brought back, in any round
  std::vector<CellId> changed_;         // since the last look
  RepairReport report_;
};

}  // namespace

template <int Dim>
RepairReport repair_topology(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const RepairOptions& options,
                             Execution& execution, LeftOutCells<Dim>* left_out) {
  if (mesh.blocks.empty() || mesh.blocks[0].type != kSimplex<Dim>) return {};
  return Repairer<Dim>(mesh, image, options, left_out, execution).run();
}

template RepairReport repair_topology(Mesh<2>&, const LabelImage<2>&, const RepairOptions&, Execution&,
                                      LeftOutCells<2>*);
template RepairReport repair_topology(Mesh<3>&, const LabelImage<3>&, const RepairOptions&, Execution&,
                                      LeftOutCells<3>*);

}  // namespace treemarch
