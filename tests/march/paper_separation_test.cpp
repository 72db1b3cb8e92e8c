#include "treemarch/march/paper_separation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "march/march_meshes.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<VertexId> all_linked(const ActiveCells<Dim>& cells, std::size_t points) {
  std::vector<VertexId> v(points);
  std::iota(v.begin(), v.end(), VertexId{0});
  std::erase_if(v, [&](VertexId i) { return !cells.linked(i); });
  return v;
}

template <int Dim>
void one_separation(int side) {
  auto mesh = testing::noise_mesh<Dim>(side, 4, 21);
  testing::jitter(mesh, 0.15, side, 2);
  Execution execution(2);
  const PaperMarchOptions<Dim> options;
  ActiveCells<Dim> cells(mesh);
  std::vector<MaterialId> before(cells.size());
  for (std::uint32_t c = 0; c < cells.size(); ++c) before[c] = cells.material(c);
  std::vector<std::array<VertexId, Dim + 1>> shape(cells.size());
  for (std::uint32_t c = 0; c < cells.size(); ++c) shape[c] = cells.cell(c);
  PaperSeparation<Dim> separation(cells, mesh.points, mesh.labels.size(), options, execution);
  PaperMarchReport report;
  const auto candidates = all_linked(cells, mesh.points.size());
  const auto old_points = mesh.points.size();
  const auto changed = separation.separate(1, candidates, report);

  EXPECT_EQ(mesh.points.size(), old_points + static_cast<std::size_t>(report.cuts));
  EXPECT_TRUE(std::ranges::is_sorted(changed));
  // What is not said to be changed is not, and what is new is said.
  for (std::uint32_t c = 0; c < cells.size(); ++c) {
    if (std::ranges::binary_search(changed, c)) continue;
    ASSERT_LT(c, before.size());
    EXPECT_EQ(cells.material(c), before[c]);
    EXPECT_EQ(cells.cell(c), shape[c]);
  }
  // Cells between other materials keep theirs or go to material 1.
  for (std::uint32_t c = 0; c < before.size(); ++c) {
    EXPECT_TRUE(before[c] == 1 || cells.material(c) == 1 || cells.material(c) == before[c]) << c;
    EXPECT_LT(cells.material(c), mesh.labels.size());
  }
  cells.write_back(mesh);
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();

  // A second separation of the same material, with vertices that are not at it among the candidates, is fine as well.
  ActiveCells<Dim> again(mesh);
  PaperSeparation<Dim> second(again, mesh.points, mesh.labels.size(), options, execution);
  second.separate(1, all_linked(again, mesh.points.size()), report);
  again.write_back(mesh);
  EXPECT_TRUE(validate(mesh, execution).fills_box());
}

TEST(PaperSeparation, ChangesWhatItSaysAndNothingElse2D) { one_separation<2>(12); }
TEST(PaperSeparation, ChangesWhatItSaysAndNothingElse3D) { one_separation<3>(6); }

// A cell that the material loses goes to the neighbour with the larger common area.
TEST(PaperSeparation, LostPartsGoToTheMajorityOfTheirNeighbours) {
  // A square of material 2 in the middle; 1 to its left, 3 on the other sides.
  auto mesh = testing::box_mesh<2>({3, 3}, [](const Coord<2>& c) {
    return c == Coord<2>{1, 1} ? 2 : c[0] == 0 ? 1 : 3;
  });
  const auto material_of = [&](std::int32_t label) {
    return static_cast<MaterialId>(std::ranges::find(mesh.labels, label) - mesh.labels.begin());
  };
  Execution execution(1);
  PaperMarchOptions<2> options;
  options.field = [](MaterialId, std::span<const Vec<2>>, std::span<double> values) {
    std::ranges::fill(values, 0.0);  // the material loses everything
  };
  ActiveCells<2> cells(mesh);
  PaperSeparation<2> separation(cells, mesh.points, mesh.labels.size(), options, execution);
  PaperMarchReport report;
  separation.separate(material_of(2), all_linked(cells, mesh.points.size()), report);
  EXPECT_EQ(report.reassigned, 2);
  EXPECT_EQ(report.cuts, 0);
  cells.write_back(mesh);
  // The square's two triangles: the one at its left and one of its other sides (a tie), the other between two sides
  // of 3.
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t i = 8; i < 10; ++i) {
    const bool left =
        std::count_if(block.cell(i), block.cell(i) + 3, [&](VertexId v) { return mesh.points[v][0] == 1; }) == 2;
    EXPECT_EQ(block.materials[i], left ? std::min(material_of(1), material_of(3)) : material_of(3));
  }
}

}  // namespace
}  // namespace treemarch
