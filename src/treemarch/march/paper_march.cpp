#include "treemarch/march/paper_march.h"

#include <algorithm>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/paper_cells.h"
#include "treemarch/march/paper_separation.h"

namespace treemarch {

namespace {

/// The whole order of separation: what the caller names, then the others by id.
std::vector<MaterialId> complete_order(const std::vector<MaterialId>& named, std::size_t materials) {
  std::vector<std::uint8_t> seen(materials, 0);
  std::vector<MaterialId> order;
  for (const MaterialId m : named) {
    if (m >= materials || seen[m]) {
      throw Error(ErrorKind::usage, "order: material " + std::to_string(m) +
                                        " is unknown or named twice; name each material of the mesh at most once");
    }
    seen[m] = 1;
    order.push_back(m);
  }
  for (MaterialId m = 0; m < materials; ++m) {
    if (!seen[m]) order.push_back(m);
  }
  return order;
}

template <int Dim>
std::vector<std::int64_t> count_cells(const Mesh<Dim>& mesh) {
  std::vector<std::int64_t> counts(mesh.labels.size(), 0);
  for (const CellBlock& block : mesh.blocks) {
    for (const MaterialId m : block.materials) ++counts[m];
  }
  return counts;
}

/// For each material the vertices where it may meet others; kept up to date as cells are split.
template <int Dim>
class Buckets {
 public:
  Buckets(const ActiveCells<Dim>& cells, VertexId vertices, std::vector<std::size_t> turn)
      : cells_(cells), turn_(std::move(turn)), buckets_(turn_.size()) {
    std::vector<MaterialId> around;
    for (VertexId v = 0; v < vertices; ++v) {
      if (!cells.linked(v)) continue;
      around.clear();
      cells.for_each_cell(v, [&](auto c, int) { around.push_back(cells.material(c)); });
      std::ranges::sort(around);
      around.erase(std::unique(around.begin(), around.end()), around.end());
      for (const MaterialId m : around) buckets_[m].push_back(v);
    }
  }

  /// The vertices of a material, ascending; the bucket is empty afterwards.
  std::vector<VertexId> take(MaterialId material, Execution& execution) {
    std::vector<VertexId> vertices = std::move(buckets_[material]);
    parallel_sort(execution, vertices);
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
  }

  /// Notes cells that are new or have a new material, for the materials whose turn comes after `now`.
  void note(const std::vector<typename ActiveCells<Dim>::Index>& changed, std::size_t now) {
    for (const auto c : changed) {
      const MaterialId m = cells_.material(c);
      if (turn_[m] <= now) continue;
      for (const VertexId v : cells_.cell(c)) {
        if (cells_.linked(v)) buckets_[m].push_back(v);
      }
    }
  }

 private:
  const ActiveCells<Dim>& cells_;
  std::vector<std::size_t> turn_;
  std::vector<std::vector<VertexId>> buckets_;
};

}  // namespace

template <int Dim>
PaperMarchReport march_materials(Mesh<Dim>& mesh, const PaperMarchOptions<Dim>& options, Execution& execution) {
  if (!(options.snap >= 0 && options.snap < 0.5)) {
    throw Error(ErrorKind::usage, "snap: not in [0, 0.5); give a fraction of an edge, 0 to move no vertex");
  }
  if (!(options.tolerance >= 0 && options.tolerance < 0.5)) {
    throw Error(ErrorKind::usage, "tolerance: not in [0, 0.5); give a small part of the range of f");
  }
  if (Dim == 4 && !options.field)
    throw Error(ErrorKind::usage, "field: four dimensions have no solid angles; give a function of position");
  const std::vector<MaterialId> order = complete_order(options.order, mesh.labels.size());
  const Execution::Stage stage(execution, "march");
  PaperMarchReport report;
  report.cells_before = count_cells(mesh);
  // Between two materials there is one surface.
  const auto present = std::ranges::count_if(report.cells_before, [](std::int64_t n) { return n > 0; });
  std::size_t turns = 0;
  std::vector<std::size_t> turn(order.size(), 0);  // from 1; 0 for those that are not separated
  for (const MaterialId m : order) {
    if (report.cells_before[m] > 0 && (present > 2 || turns == 0)) turn[m] = ++turns;
  }
  ActiveCells<Dim> cells(mesh);
  Buckets<Dim> buckets(cells, static_cast<VertexId>(mesh.points.size()), turn);
  PaperSeparation<Dim> separation(cells, mesh.points, order.size(), options, execution);
  for (const MaterialId m : order) {
    if (turn[m] == 0) continue;
    const auto changed = separation.separate(m, buckets.take(m, execution), report);
    buckets.note(changed, turn[m]);
    execution.progress(static_cast<double>(turn[m]) / static_cast<double>(turns));
  }
  cells.write_back(mesh);
  report.cells_after = count_cells(mesh);
  for (MaterialId m = 0; m < report.cells_before.size(); ++m) {
    if (report.cells_before[m] > 0 && report.cells_after[m] == 0) report.lost.push_back(m);
  }
  return report;
}

template PaperMarchReport march_materials<2>(Mesh<2>&, const PaperMarchOptions<2>&, Execution&);
template PaperMarchReport march_materials<3>(Mesh<3>&, const PaperMarchOptions<3>&, Execution&);
template PaperMarchReport march_materials<4>(Mesh<4>&, const PaperMarchOptions<4>&, Execution&);

}  // namespace treemarch
