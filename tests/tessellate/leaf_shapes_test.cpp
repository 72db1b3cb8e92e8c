#include "treemarch/tessellate/leaf_shapes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/meshes.h"
#include "support/trees.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

using testing::TreeCase;

template <int Dim>
std::vector<std::uint8_t> random_leaves(const Spacetree<Dim>& tree, unsigned seed, unsigned one_in) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> flags(tree.leaves.size());
  for (auto& f : flags) f = random() % one_in == 0;
  return flags;
}

template <int Dim>
bool touch(const Spacetree<Dim>& tree, const Leaf<Dim>& a, const Leaf<Dim>& b) {
  for (int d = 0; d < Dim; ++d)
    if (a.corner[d] > b.corner[d] + tree.extent_of(b)[d] || b.corner[d] > a.corner[d] + tree.extent_of(a)[d])
      return false;
  return true;
}

std::int64_t cells_of(const auto& mesh, CellType type) {
  std::int64_t n = 0;
  for (const CellBlock& b : mesh.blocks)
    if (b.type == type) n += b.size();
  return n;
}

/// A hybrid mesh fills the box without a gap and keeps the volume of each material; boxes are what the shapes say.
template <int Dim>
void expect_sound_hybrid(Spacetree<Dim> tree, const std::vector<std::uint8_t>& cut) {
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) tree.leaves[i].material = static_cast<MaterialId>(i * 7 % 3);
  Execution execution(2);
  const std::vector<LeafShape> shapes = choose_leaf_shapes<Dim>(tree, cut, execution);
  MidpointOptions options;
  options.shapes = shapes;
  Mesh<Dim> mesh = tessellate_midpoint(tree, options, execution);
  mesh.labels = {5, 6, 7};
  const MeshDefects defects = validate(mesh, execution);
  EXPECT_TRUE(defects.fills_box()) << defects.describe();
  EXPECT_EQ(cells_of(mesh, Dim == 2 ? CellType::quad : CellType::hexahedron),
            std::ranges::count(shapes, LeafShape::box));
  std::array<double, 3> volume{}, expected{};
  for (const CellBlock& b : mesh.blocks)
    for (std::int64_t c = 0; c < b.size(); ++c)
      volume[b.materials[c]] += cell_volume<Dim>(mesh.points.data(), b.type, b.cell(c));
  for (const Leaf<Dim>& leaf : tree.leaves) {
    double v = 1;
    for (int d = 0; d < Dim; ++d) v *= tree.extent_of(leaf)[d] * tree.lattice.unit[d];
    expected[leaf.material] += v;
  }
  for (int m = 0; m < 3; ++m) EXPECT_NEAR(volume[m], expected[m], 1e-9 * expected[m]);
  for (std::size_t i = 0; i < cut.size(); ++i) EXPECT_EQ(cut[i] != 0, shapes[i] == LeafShape::simplices);
  Execution serial(1);
  Mesh<Dim> again = tessellate_midpoint(tree, options, serial);
  again.labels = mesh.labels;
  EXPECT_TRUE(testing::same_mesh(mesh, again));
}

const std::vector<TreeCase> kTrees{{{"2", "2", "2"}, 1, {16}, 1},           {{"2", "2", "2"}, 2, {16}, 2},
                                   {{"2", "2", "2"}, kUnbalanced, {16}, 3}, {{"3", "2"}, kUnbalanced, {12}, 4},
                                   {{"2", "221"}, 1, {8, 12, 6}, 5},        {{"212", "2"}, kUnbalanced, {12, 4, 8}, 6},
                                   {{"2", "3"}, 1, {13, 11, 9}, 7}};

TEST(LeafShapes, HybridMeshesOfAnyTreeAreSound) {
  for (const TreeCase& c : kTrees)
    for (const unsigned one_in : {1U, 2U, 12U, 1000000U}) {
      SCOPED_TRACE(::testing::PrintToString(c));
      const auto solid = testing::tree_of<3>(c, 1);
      expect_sound_hybrid(solid, random_leaves(solid, c.seed, one_in));
      const auto flat = testing::tree_of<2>(c, 1);
      expect_sound_hybrid(flat, random_leaves(flat, c.seed, one_in));
    }
}

TEST(LeafShapes, UniformTreeIsAllBoxesUnlessItIsCut) {
  const auto tree = testing::tree_of<3>({{"2"}, 1, {6}, 1, 0}, 1);
  std::vector<std::uint8_t> cut(tree.leaves.size(), 0);
  Execution execution(2);
  EXPECT_EQ(std::ranges::count(choose_leaf_shapes<3>(tree, cut, execution), LeafShape::box), 27);
  cut[tree.leaf_at({3, 3, 3})] = 1;  // its six neighbours become transitions
  const auto shapes = choose_leaf_shapes<3>(tree, cut, execution);
  EXPECT_EQ(std::ranges::count(shapes, LeafShape::transition), 6);
  EXPECT_EQ(std::ranges::count(shapes, LeafShape::box), 20);
}

template <int Dim>
void expect_touching_leaves(const TreeCase& c) {
  const auto tree = testing::tree_of<Dim>(c, 1);
  std::vector<MaterialId> material(tree.leaves.size(), 0);
  const auto other = random_leaves(tree, c.seed, 40);
  for (std::size_t i = 0; i < material.size(); ++i)
    if (other[i]) material[i] = i % 2 ? kOutside : 1;
  Execution execution(2);
  const auto found = leaves_at_interfaces<Dim>(tree, material, execution);
  for (std::size_t i = 0; i < material.size(); ++i) {
    bool expected = material[i] == kOutside;
    for (std::size_t j = 0; j < material.size(); ++j)
      expected |=
          (material[i] != material[j] || material[j] == kOutside) && touch(tree, tree.leaves[i], tree.leaves[j]);
    ASSERT_EQ(found[i] != 0, expected);
  }
}

TEST(LeafShapes, InterfacesAreWhereLeavesOfTwoMaterialsTouch) {
  for (const TreeCase& c : kTrees) {
    SCOPED_TRACE(::testing::PrintToString(c));
    expect_touching_leaves<2>(c);
    expect_touching_leaves<3>(c);
  }
}

}  // namespace
}  // namespace treemarch
