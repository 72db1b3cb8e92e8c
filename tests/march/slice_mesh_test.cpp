#include "treemarch/march/slice_mesh.h"

#include <gtest/gtest.h>

#include <random>

#include "support/meshes.h"
#include "treemarch/core/error.h"
#include "treemarch/mesh/validate.h"

namespace treemarch {
namespace {

using testing::box_mesh;
using testing::same_mesh;

/// Boxes of Kuhn simplices with labels that change along the first axis alone, their inner vertices shaken.
template <int Dim>
Mesh<Dim> shaken_mesh(const Coord<Dim>& extent, double by) {
  Mesh<Dim> mesh = box_mesh<Dim>(extent, [](const Coord<Dim>& c) { return 10 + c[0]; });
  std::mt19937 random(5);
  std::uniform_real_distribution<double> offset(-by, by);
  for (Vec<Dim>& p : mesh.points) {
    for (int d = 0; d < Dim; ++d) {
      const double shift = offset(random);
      // Vertices on the interfaces between labels stay in them.
      if (d > 0 && p[d] > 0 && p[d] < extent[d]) p[d] += shift;
    }
  }
  return mesh;
}

template <int Dim>
void expect_full_slices(const Coord<Dim>& extent, double by) {
  const Mesh<Dim> mesh = shaken_mesh(extent, by);
  const Execution one(1), two(2);
  ASSERT_TRUE(validate(mesh, one).fills_box());
  for (const double t : {0.0, 0.01, 0.5, 1.0, 1.0 + 1e-9, 1.37, 2.0, extent[Dim - 1] - 0.01, 1.0 * extent[Dim - 1]}) {
    SCOPED_TRACE(t);
    const Mesh<Dim - 1> slice = slice_mesh(mesh, t, one);
    const MeshDefects defects = validate(slice, one);
    EXPECT_TRUE(defects.fills_box()) << defects.describe();
    EXPECT_NEAR(defects.volume, static_cast<double>(product(extent)) / extent[Dim - 1], 1e-9);
    // Each label keeps its part of the box.
    std::vector<double> volume(mesh.labels.size());
    for (std::int64_t c = 0; c < slice.blocks[0].size(); ++c)
      volume[slice.blocks[0].materials[c]] +=
          cell_volume<Dim - 1>(slice.points.data(), kSimplex<Dim - 1>, slice.blocks[0].cell(c));
    for (const double v : volume) EXPECT_NEAR(v, defects.volume / extent[0], 1e-9);
    EXPECT_TRUE(same_mesh(slice_mesh(mesh, t, two), slice));
  }
}

TEST(SliceMesh, SectionsOfABoxAreBoxes) {
  for (const double by : {0.0, 0.1}) {
    expect_full_slices<3>({3, 4, 3}, by);
    expect_full_slices<4>({3, 2, 2, 3}, by);
  }
}

TEST(SliceMesh, APlaneThroughVerticesMakesNoNewOnes) {
  const Mesh<4> mesh = shaken_mesh<4>({2, 2, 2, 3}, 0);
  const Execution execution(1);
  for (const double t : {0.0, 1.0, 2.0, 3.0}) EXPECT_EQ(slice_mesh(mesh, t, execution).points.size(), 27U) << t;
}

TEST(SliceMesh, MaterialThatEndsInThePlaneBelongsToTheTimeBefore) {
  const Execution execution(1);
  const Mesh<4> mesh = box_mesh<4>({1, 1, 1, 2}, [](const Coord<4>& c) { return c[3]; });
  const Mesh<3> slice = slice_mesh(mesh, 1.0, execution);
  ASSERT_GT(slice.cell_count(), 0);
  for (const MaterialId m : slice.blocks[0].materials) EXPECT_EQ(mesh.labels[m], 0);
}

TEST(SliceMesh, IsEmptyBeyondTheMesh) {
  const Execution execution(1);
  for (const double t : {-1.0, 3.5})
    EXPECT_EQ(slice_mesh(shaken_mesh<4>({1, 1, 1, 3}, 0), t, execution).cell_count(), 0);
}

TEST(SliceMesh, OfOtherCellsIsRefused) {
  const Execution execution(1);
  EXPECT_THROW(slice_mesh(testing::mixed_mesh(), 0.5, execution), Error);
}

}  // namespace
}  // namespace treemarch
