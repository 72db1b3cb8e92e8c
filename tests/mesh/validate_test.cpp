#include "treemarch/mesh/validate.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/meshes.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::mixed_mesh;

template <int Dim>
void expect_sound_box(const Coord<Dim>& extent, const Vec<Dim>& unit) {
  const Execution execution(2);
  const Mesh<Dim> mesh = box_mesh<Dim>(
      extent, [](const Coord<Dim>& c) { return c[0]; }, unit);
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_TRUE(defects.fills_box()) << Dim << "D: " << defects.describe();
  double volume = 1;
  for (int d = 0; d < Dim; ++d) volume *= extent[d] * unit[d];
  EXPECT_NEAR(defects.volume, volume, 1e-12 * volume);
  EXPECT_EQ(defects.describe(), "sound");
}

TEST(Validate, AcceptsBoxesOfAllDimensions) {
  expect_sound_box<1>({5}, {0.3});
  expect_sound_box<2>({5, 3}, {0.3, 2});
  expect_sound_box<3>({5, 3, 4}, {0.3, 2, 1});
  expect_sound_box<4>({2, 3, 2, 2}, {0.3, 2, 1, 5});
}

TEST(Validate, AcceptsMixedCells) {
  const MeshDefects defects = validate(mixed_mesh(), Execution(1));
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_DOUBLE_EQ(defects.volume, 2);
}

/// Breaks a sound mesh in one way.
template <class Break>
MeshDefects defects_after(Break&& damage) {
  Mesh<3> mesh = box_mesh<3>({3, 3, 3}, [](const Coord<3>& c) { return c[2]; });
  damage(mesh);
  const MeshDefects defects = validate(mesh, Execution(2));
  EXPECT_FALSE(defects.fills_box());
  return defects;
}

TEST(Validate, FindsInvertedCells) {
  const MeshDefects d = defects_after([](Mesh<3>& m) { std::swap(m.blocks[0].vertices[0], m.blocks[0].vertices[1]); });
  EXPECT_EQ(d.inverted_cells, 1);
  EXPECT_EQ(d.folded_facets, 3);  // the inner facets of the first simplex; its fourth is on the hull
  EXPECT_FALSE(d.sound());
}

TEST(Validate, FindsInvertedCornersOfHexahedra) {
  Mesh<3> mesh = mixed_mesh();
  mesh.points[0] = {0.9, 0.9, 0.9};  // a corner pushed through its neighbours' plane; the volume stays positive
  const MeshDefects d = validate(mesh, Execution(1));
  EXPECT_EQ(d.inverted_cells, 1);
}

TEST(Validate, FindsNaN) {
  const MeshDefects d = defects_after([](Mesh<3>& m) { m.points[0][1] = std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_EQ(d.inverted_cells, 6);  // all simplices of a Kuhn box have its lowest corner
}

TEST(Validate, FindsOverusedFacets) {
  const MeshDefects d = defects_after([](Mesh<3>& m) {
    CellBlock& b = m.blocks[0];
    b.vertices.insert(b.vertices.end(), b.vertices.begin(), b.vertices.begin() + 4);
    b.materials.push_back(0);
  });
  EXPECT_EQ(d.overused_facets, 3);
  EXPECT_EQ(d.folded_facets, 1);  // the copy lies on the same side of the facet that was on the hull
}

TEST(Validate, FindsHoles) {
  const MeshDefects d = defects_after([](Mesh<3>& m) {
    const std::size_t middle = 13 * 6;  // a simplex of the box in the middle
    m.blocks[0].vertices.erase(m.blocks[0].vertices.begin() + 4 * middle,
                               m.blocks[0].vertices.begin() + 4 * middle + 4);
    m.blocks[0].materials.erase(m.blocks[0].materials.begin());
  });
  EXPECT_TRUE(d.sound());
  EXPECT_EQ(d.facets_off_the_box, 4);
}

TEST(Validate, FindsCoincidentAndUnusedPoints) {
  MeshDefects d = defects_after([](Mesh<3>& m) { m.points.push_back({0.5, 0.25, 1}); });
  EXPECT_EQ(d.unused_points, 1);
  EXPECT_EQ(d.coincident_points, 0);
  d = defects_after([](Mesh<3>& m) {
    m.points.push_back(m.points[17]);
    m.blocks[0].vertices[std::find(m.blocks[0].vertices.begin(), m.blocks[0].vertices.end(), 17U) -
                         m.blocks[0].vertices.begin()] = static_cast<VertexId>(m.points.size() - 1);
  });
  EXPECT_EQ(d.coincident_points, 1);
  EXPECT_EQ(d.unused_points, 0);
  EXPECT_GT(d.facets_off_the_box, 0);
}

TEST(Validate, FindsBadCellsAndMaterials) {
  MeshDefects d = defects_after([](Mesh<3>& m) { m.blocks[0].vertices[2] = 1000; });
  EXPECT_EQ(d.bad_cells, 1);
  d = defects_after([](Mesh<3>& m) { m.blocks[0].vertices[2] = m.blocks[0].vertices[1]; });
  EXPECT_EQ(d.bad_cells, 1);
  d = defects_after([](Mesh<3>& m) { m.blocks[0].materials[5] = 3; });
  EXPECT_EQ(d.unknown_materials, 1);
}

}  // namespace
}  // namespace treemarch
