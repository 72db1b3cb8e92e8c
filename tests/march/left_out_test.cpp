#include "treemarch/march/left_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/images.h"
#include "treemarch/march/cut.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"

namespace treemarch {
namespace {

template <int Dim>
struct Lattice {
  LabelImage<Dim> image;
  SimplexLattice<Dim> lattice;
  Field<Dim> field;
  Execution execution{2};

  /// A ball and some noise beside it, in cells that grow away from interfaces.
  explicit Lattice(unsigned seed) : image(testing::ball_image<Dim>(extent(), 0.2)) {
    std::mt19937 random(seed);
    for (int k = 0; k < 5; ++k) image.voxels.set(static_cast<std::int64_t>(random() % image.voxels.size()), 1);
    const auto sized = choose_cubic_lattice(image, 1.0, 8.0);
    SizingRule rule;
    rule.min_size = 1.3;
    rule.max_size = 8;
    const auto levels = required_levels(image, sized, rule, execution);
    lattice = tessellate_body_centred<Dim>(build_spacetree<Dim>(sized.lattice, sized.pattern, levels, 1, execution),
                                           execution);
    field = build_field(image, {}, execution);
  }
  static Coord<Dim> extent() {
    Coord<Dim> e;
    e.fill(Dim == 2 ? 60 : 24);
    return e;
  }
  Mesh<Dim> cut(MaterialId left_out, CutReport& report) {
    CutOptions options;
    options.left_out = left_out;
    return cut_lattice(lattice, field, image.labels, options, report, execution);
  }
};

/// Vertices in order and the material, of cells from the first on, sorted.
template <int Dim>
std::vector<std::pair<std::array<VertexId, Dim + 1>, MaterialId>> cells_of(const Mesh<Dim>& mesh,
                                                                           std::int64_t first = 0) {
  std::vector<std::pair<std::array<VertexId, Dim + 1>, MaterialId>> cells;
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t c = first; c < block.size(); ++c) {
    std::array<VertexId, Dim + 1> v;
    std::copy_n(block.cell(c), Dim + 1, v.begin());
    cells.emplace_back(v, block.materials[static_cast<std::size_t>(c)]);
  }
  std::ranges::sort(cells);
  return cells;
}

template <int Dim>
void expect_all_can_be_had(unsigned seed) {
  Lattice<Dim> input(seed);
  const MaterialId background = material_of(input.image.labels, 0);
  CutReport report, of_whole;
  const Mesh<Dim> whole = input.cut(kOutside, of_whole);
  Mesh<Dim> mesh = input.cut(background, report);
  EXPECT_EQ(mesh.points, whole.points);
  EXPECT_EQ(report.lattice_simplices, of_whole.lattice_simplices);
  EXPECT_EQ(report.at_interfaces, of_whole.at_interfaces);
  const std::int64_t missing = of_whole.far_cells - report.far_cells;
  EXPECT_GT(missing, 100);
  EXPECT_EQ(whole.cell_count() - mesh.cell_count(), missing);
  const auto materials = mesh.blocks[0].materials.begin();
  EXPECT_EQ(std::count(materials, materials + report.far_cells, background), 0);

  // First those of some vertices, in two steps that have cells in common; then all.
  LeftOutCells<Dim> left_out(input.lattice, report.left_out, background);
  for (const unsigned step : {7U, 5U}) {
    Marks marks(mesh.points.size());
    for (std::size_t v = 0; v < mesh.points.size(); v += step) marks.mark(v);
    left_out.append_at(mesh, marks, input.execution);
    // As many cells as in the whole mesh have them.
    const auto count = [&](const Mesh<Dim>& m) {
      return std::ranges::count_if(cells_of(m), [&](const auto& cell) {
        return std::ranges::any_of(cell.first, [&](VertexId v) { return v % step == 0; });
      });
    };
    EXPECT_EQ(count(mesh), count(whole));
    EXPECT_LT(mesh.cell_count(), whole.cell_count());
  }
  const std::int64_t before = mesh.cell_count();
  left_out.append_if(
      mesh, [](const auto&) { return false; }, input.execution);
  EXPECT_EQ(mesh.cell_count(), before);
  left_out.append_if(
      mesh, [](const auto&) { return true; }, input.execution);
  EXPECT_EQ(cells_of(mesh), cells_of(whole));
  left_out.append_if(
      mesh, [](const auto&) { return true; }, input.execution);
  EXPECT_EQ(mesh.cell_count(), whole.cell_count());
}

TEST(left_out, cells_can_all_be_had_once) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    expect_all_can_be_had<2>(seed);
    expect_all_can_be_had<3>(seed);
  }
}

}  // namespace
}  // namespace treemarch
