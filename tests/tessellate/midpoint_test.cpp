#include "treemarch/tessellate/midpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "support/simplices.h"
#include "support/trees.h"
#include "treemarch/sizing/assign_materials.h"
#include "treemarch/sizing/sizing.h"

namespace treemarch {
namespace {

using testing::TreeCase;

template <int Dim>
Mesh<Dim> mesh_of(const Spacetree<Dim>& tree, int threads, bool templates = true) {
  Execution execution(threads);
  MidpointOptions options;
  options.templates = templates;
  return tessellate_midpoint(tree, options, execution);
}

template <int Dim>
Spacetree<Dim> coloured_tree_of(const TreeCase& c) {
  Spacetree<Dim> tree = testing::tree_of<Dim>(c, 1);
  for (std::size_t i = 0; i < tree.leaves.size(); ++i) tree.leaves[i].material = static_cast<MaterialId>(i * 7 % 3);
  return tree;
}

/// Counts simplices and vertices by geometry alone: intervals of leaves, no levels, no lookups, no bit sets.
template <int Dim>
class BruteForce {
 public:
  explicit BruteForce(const Spacetree<Dim>& tree) {
    for (const Leaf<Dim>& leaf : tree.leaves) {
      Box box{};
      for (int d = 0; d < Dim; ++d) box[d] = {leaf.corner[d], leaf.corner[d] + tree.extent_of(leaf)[d]};
      leaves_.push_back(box);
      for (int far = 0; far < 1 << Dim; ++far) {
        Point p{};
        for (int d = 0; d < Dim; ++d) p[d] = 2 * ((far >> d & 1) != 0 ? box[d].second : box[d].first);
        corners_.insert(p);
      }
    }
    vertices_ = corners_;
    for (const Box& leaf : leaves_) cells_ += divide(leaf);
  }
  [[nodiscard]] std::int64_t cells() const { return cells_; }
  [[nodiscard]] std::int64_t vertices() const { return static_cast<std::int64_t>(vertices_.size()); }

 private:
  using Box = std::array<std::pair<std::int64_t, std::int64_t>, Dim>;
  using Point = std::array<std::int64_t, Dim>;

  static int dimension_of(const Box& box) {
    return static_cast<int>(std::count_if(box.begin(), box.end(), [](const auto& i) { return i.first < i.second; }));
  }
  static std::vector<Box> facets_of(const Box& box) {
    std::vector<Box> result;
    for (int d = 0; d < Dim; ++d) {
      if (box[d].first == box[d].second) continue;
      for (const std::int64_t at : {box[d].first, box[d].second}) {
        result.push_back(box);
        result.back()[d] = {at, at};
      }
    }
    return result;
  }
  bool regular(const Box& box) const {
    if (dimension_of(box) > 1) {
      const auto facets = facets_of(box);
      return std::all_of(facets.begin(), facets.end(), [&](const Box& f) { return regular(f); });
    }
    return std::none_of(corners_.begin(), corners_.end(), [&](const Point& p) {
      bool inside = true;
      for (int d = 0; d < Dim; ++d)
        inside = inside && (box[d].first == box[d].second ? p[d] == 2 * box[d].first
                                                          : p[d] > 2 * box[d].first && p[d] < 2 * box[d].second);
      return inside;
    });
  }
  /// The smallest traces of leaves on a face.
  std::vector<Box> pieces_of(const Box& face) const {
    const int dim = dimension_of(face);
    std::set<Box> traces;
    for (const Box& leaf : leaves_) {
      Box trace{};
      bool meets = true;
      for (int d = 0; d < Dim; ++d) {
        trace[d] = {std::max(leaf[d].first, face[d].first), std::min(leaf[d].second, face[d].second)};
        meets = meets && trace[d].first <= trace[d].second;
      }
      if (meets && dimension_of(trace) == dim) traces.insert(trace);
    }
    std::vector<Box> smallest;
    for (const Box& a : traces) {
      const bool covers = std::any_of(traces.begin(), traces.end(), [&](const Box& b) {
        bool inside = a != b;
        for (int d = 0; d < Dim; ++d) inside = inside && b[d].first >= a[d].first && b[d].second <= a[d].second;
        return inside;
      });
      if (!covers) smallest.push_back(a);
    }
    return smallest;
  }
  std::int64_t divide(const Box& box) {
    const int dim = dimension_of(box);
    if (dim == 1) return 1;
    if (const auto known = divided_.find(box); known != divided_.end()) return known->second;
    std::int64_t n = dim == 2 ? 2 : dim == 3 ? 5 : 16;
    if (!regular(box)) {
      Point centre{};
      for (int d = 0; d < Dim; ++d) centre[d] = box[d].first + box[d].second;
      vertices_.insert(centre);
      n = 0;
      for (const Box& facet : facets_of(box))
        for (const Box& piece : pieces_of(facet)) n += divide(piece);
    }
    return divided_[box] = n;
  }

  std::vector<Box> leaves_;
  std::set<Point> corners_, vertices_;
  std::map<Box, std::int64_t> divided_;
  std::int64_t cells_ = 0;
};

/// Extended templates: as exact, and no more vertices and cells; in 3D no others than corners and centres of leaves.
template <int Dim>
void check_extended(const Spacetree<Dim>& tree, const Mesh<Dim>& plain) {
  Execution execution(2);
  MidpointOptions options;
  options.facets = FacetRule::extended;
  const Mesh<Dim> mesh = tessellate_midpoint(tree, options, execution);
  testing::expect_exact_tessellation(mesh, tree);
  EXPECT_LE(mesh.points.size(), plain.points.size());
  EXPECT_LE(mesh.cell_count(), plain.cell_count());
  if constexpr (Dim == 3) {
    std::set<std::array<std::int64_t, 3>> corners;
    for (const Leaf<3>& leaf : tree.leaves)
      for (int far = 0; far < 8; ++far) {
        std::array<std::int64_t, 3> c{};
        for (int d = 0; d < 3; ++d) c[d] = leaf.corner[d] + ((far >> d & 1) != 0 ? tree.extent_of(leaf)[d] : 0);
        corners.insert(c);
      }
    EXPECT_LE(mesh.points.size() - corners.size(), tree.leaves.size());
  }
}

template <int Dim>
void check_case(const TreeCase& c, bool count) {
  SCOPED_TRACE(::testing::PrintToString(c));
  const auto tree = coloured_tree_of<Dim>(c);
  const Mesh<Dim> mesh = mesh_of(tree, 1);
  testing::expect_exact_tessellation(mesh, tree);
  if (count && tree.leaves.size() < (Dim < 4 ? 250U : 100U)) {  // the brute force is slow in 4D
    const BruteForce<Dim> expected(tree);
    EXPECT_EQ(mesh.cell_count(), expected.cells());
    EXPECT_EQ(static_cast<std::int64_t>(mesh.points.size()), expected.vertices());
  }
  const Mesh<Dim> again = mesh_of(tree, 2);
  EXPECT_EQ(again.points, mesh.points);
  EXPECT_EQ(again.blocks[0].vertices, mesh.blocks[0].vertices);
  EXPECT_EQ(again.blocks[0].materials, mesh.blocks[0].materials);
  testing::expect_exact_tessellation(mesh_of(tree, 1, false), tree);
  if constexpr (Dim > 2)
    if (tree.leaves.size() < 300) check_extended(tree, mesh);
}

/// Every pattern with every balance, extents that are and are not multiples of the roots, few and many small leaves.
/// \param thin whether some levels differ in thickness alone; the template then fits some regular cells only.
template <int Dim>
void check_table(const std::vector<std::vector<std::string>>& patterns, const std::vector<std::vector<int>>& extents,
                 bool thin = false) {
  for (const auto& pattern : patterns)
    for (const auto& extent : extents)
      for (const double density : {0.0, 0.004, 0.03})
        for (const int balance : {kUnbalanced, 1, 2}) check_case<Dim>({pattern, balance, extent, 3, density}, !thin);
}

TEST(MidpointTessellation, IsExact1D) {
  check_table<1>({{}, {"2", "2", "2", "2"}, {"3", "3"}, {"5", "2"}}, {{16}, {27}, {7}});
}

TEST(MidpointTessellation, IsExact2D) {
  check_table<2>({{}, {"2", "2", "2", "2"}, {"3", "3", "3"}, {"32", "2", "23", "2"}, {"4", "3"}},
                 {{16, 32}, {27, 27}, {23, 9}});
}

TEST(MidpointTessellation, IsExact2DWithFactorsOfOne) {
  check_table<2>({{"21", "21", "2", "2"}, {"12", "21", "12", "2"}}, {{16, 32}, {23, 9}});
}

TEST(MidpointTessellation, IsExact3D) {
  check_table<3>({{}, {"2", "2", "2"}, {"3", "3"}, {"2", "3"}, {"4", "2"}}, {{8, 8, 16}, {9, 9, 9}, {11, 6, 7}});
}

TEST(MidpointTessellation, IsExact3DWithThinLevels) {
  check_table<3>({{"221", "221", "2"}, {"2", "221"}, {"3", "223"}}, {{8, 8, 8}, {12, 7, 5}});
  check_table<3>({{"211", "2"}, {"112", "221", "2"}, {"211", "121", "112", "2"}, {"311", "131", "2"}},
                 {{8, 8, 8}, {12, 7, 5}}, true);
}

TEST(MidpointTessellation, IsExact4D) {
  check_table<4>({{"2", "2"}, {"3"}, {"2221", "2"}}, {{4, 4, 4, 4}, {6, 3, 4, 5}});
  check_table<4>({{"2111", "1222", "2"}, {"1112", "2221"}}, {{4, 4, 4, 4}, {5, 4, 3, 2}}, true);
}

TEST(MidpointTessellation, ManyRandomTrees) {
  for (unsigned seed = 0; seed < 24; ++seed) {
    const double density = 0.0005 * (1 << seed % 6);
    const int balance = static_cast<int>(seed % 4);
    check_case<2>({{"2", "2", "2", "2", "2"}, balance, {64, 64}, seed, density}, true);
    check_case<3>({{"2", "2", "2", "2"}, balance, {32, 16, 16}, seed, density}, true);
    check_case<3>({{"3", "2", "221"}, balance, {24, 12, 13}, seed, density}, true);
  }
}

/// Cells of each label, from sizes to simplices.
std::map<std::int32_t, std::int64_t> cells_by_label(const Coord<3>& extent,
                                                    const std::function<std::int32_t(const Coord<3>&)>& label) {
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) values.push_back(label(coord_of(i, extent)));
  const auto image = make_label_image<3>(extent, values);
  Execution execution(1);
  const SizingRule rule{.min_size = 0, .max_size = 8, .material_size = {}, .interface_size = {}};
  const auto sized = choose_lattice<3>(image, {}, rule, execution);
  auto tree =
      build_spacetree<3>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1, execution);
  assign_materials(tree, image, {}, execution);
  const auto mesh = tessellate_midpoint(tree, {}, execution);
  std::map<std::int32_t, std::int64_t> count;
  for (const MaterialId m : mesh.blocks[0].materials) ++count[image.labels[m]];
  return count;
}

TEST(MidpointTessellation, MirrorAndRotationGiveAsManyCells) {
  const Coord<3> extent{48, 32, 16};
  const auto label = [](const Coord<3>& c) {
    const double f = std::sin(0.21 * c[0]) + std::sin(0.17 * c[1] + 1) + std::sin(0.3 * c[2] + 0.04 * c[0]);
    return f < -0.5 ? 3 : f < 0.9 ? 0 : 8;
  };
  const auto expected = cells_by_label(extent, label);
  ASSERT_EQ(expected.size(), 3U);
  const auto mapped = [&](const Coord<3>& e, auto&& map) {
    return cells_by_label(e, [&](const Coord<3>& c) { return label(map(c)); });
  };
  EXPECT_EQ(mapped(extent, [](Coord<3> c) { return Coord<3>{47 - c[0], c[1], c[2]}; }), expected);
  EXPECT_EQ(mapped(extent, [](Coord<3> c) { return Coord<3>{c[0], c[1], 15 - c[2]}; }), expected);
  EXPECT_EQ(mapped({32, 48, 16}, [](Coord<3> c) { return Coord<3>{c[1], 31 - c[0], c[2]}; }), expected);
  EXPECT_EQ(mapped({16, 32, 48}, [](Coord<3> c) { return Coord<3>{47 - c[2], c[1], c[0]}; }), expected);
}

TEST(MidpointTessellation, UniformCubesTakeTheTemplate) {
  const auto tree = coloured_tree_of<3>({{"2", "2"}, 1, {8, 4, 4}, 1, 0});
  EXPECT_EQ(mesh_of(tree, 1).cell_count(), 5 * 2);
  EXPECT_EQ(mesh_of(tree, 1).points.size(), 3 * 2 * 2);
  EXPECT_EQ(mesh_of(tree, 1, false).cell_count(), 12 * 2);
}

TEST(MidpointTessellation, UniformCellsOfFourDimensionsTakeTheTemplate) {
  const auto tree = coloured_tree_of<4>({{"2", "2"}, 1, {8, 4, 4, 4}, 1, 0});
  EXPECT_EQ(mesh_of(tree, 1).cell_count(), 16 * 2);
  EXPECT_EQ(mesh_of(tree, 1).points.size(), 3 * 2 * 2 * 2);
  EXPECT_EQ(mesh_of(tree, 1, false).cell_count(), 8 * 5 * 2);
}

}  // namespace
}  // namespace treemarch
