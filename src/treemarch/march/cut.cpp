#include "treemarch/march/cut.h"

#include "treemarch/core/parallel.h"
#include "treemarch/march/band.h"
#include "treemarch/march/classify.h"
#include "treemarch/march/emit.h"
#include "treemarch/march/retreat.h"

namespace treemarch {

template <int Dim>
Mesh<Dim> cut_lattice(const SimplexLattice<Dim>& lattice, const Field<Dim>& field,
                      const std::vector<std::int32_t>& image_labels, const CutOptions& options, CutReport& report,
                      Execution& execution) {
  const SnappedLattice<Dim> snapped =
      snap_vertices(lattice, classify_vertices(lattice, field, execution), field, options.snap, execution);
  execution.progress(0.4);
  const Band<Dim> band(lattice, snapped.labels, options.left_out, execution);
  Mesh<Dim> mesh;
  CutGeometry<Dim> geometry(lattice, band, snapped, mesh.points, execution);
  geometry.retreat(options.quality_floor, execution);
  execution.progress(0.8);
  mesh.labels = image_labels;
  const EmitReport emitted = emit_pieces(lattice, band, snapped, geometry, field, mesh, execution);
  report.at_interfaces.assign(mesh.points.size(), 1);
  report.left_out = {band.leaves_left_out(), Marks(lattice.vertices.size())};
  parallel_for(execution, std::ssize(lattice.vertices), 1 << 16, [&](std::int64_t i) {
    const auto v = static_cast<VertexId>(i);
    const bool single = snapped.labels.single(v);
    report.at_interfaces[v] = !single;
    if (single && snapped.labels.of(v)[0] == options.left_out) report.left_out.vertices.mark(v);
  });
  report.lattice_vertices = static_cast<std::int64_t>(lattice.vertices.size());
  report.band_simplices = band.size();
  report.far_cells = band.far_count();
  report.lattice_simplices = report.band_simplices + report.far_cells + band.left_out_count();
  report.cut_edges = emitted.cut_edges;
  report.triple_points = emitted.triple_points;
  report.inner_points = emitted.inner_points;
  report.snapped_vertices = snapped.snapped;
  report.retreated_points = geometry.retreated;
  report.retreat_rounds = geometry.rounds;
  return mesh;
}

template Mesh<2> cut_lattice(const SimplexLattice<2>&, const Field<2>&, const std::vector<std::int32_t>&,
                             const CutOptions&, CutReport&, Execution&);
template Mesh<3> cut_lattice(const SimplexLattice<3>&, const Field<3>&, const std::vector<std::int32_t>&,
                             const CutOptions&, CutReport&, Execution&);

}  // namespace treemarch
