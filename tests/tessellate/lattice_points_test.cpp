#include "treemarch/tessellate/lattice_points.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace treemarch {
namespace {

TEST(LatticePoints, NumbersArePositionsInSortedOrder) {
  const Lattice<3> lattice{{70, 40, 31}, {0.5, 1, 3}};
  LatticePoints<3> points(lattice);
  std::mt19937 random(5);
  std::set<std::array<int, 3>> expected;  // last axis first, the order of the numbers
  for (int i = 0; i < 20000; ++i) {
    const Coord<3> p{static_cast<int>(random() % 141), static_cast<int>(random() % 81),
                     static_cast<int>(random() % 63)};
    points.insert(p);
    expected.insert({p[2], p[1], p[0]});
  }
  const Coord<3> far{140, 80, 62};
  points.insert(far);
  expected.insert({far[2], far[1], far[0]});
  Execution execution(2);
  ASSERT_EQ(points.number(execution), static_cast<std::int64_t>(expected.size()));
  const auto positions = points.positions(lattice, execution);
  ASSERT_EQ(positions.size(), expected.size());
  VertexId id = 0;
  for (const auto& [z, y, x] : expected) {
    EXPECT_EQ(points.id({x, y, z}), id);
    EXPECT_EQ(positions[id], (Vec<3>{x * 0.25, y * 0.5, z * 1.5}));
    ++id;
  }
}

TEST(LatticePoints, ContainsWhatWasInserted) {
  LatticePoints<2> points({{3, 3}, {1, 1}});
  points.insert({6, 1});
  EXPECT_TRUE(points.contains({6, 1}));
  EXPECT_FALSE(points.contains({5, 1}));
  EXPECT_FALSE(points.contains({0, 2}));
}

}  // namespace
}  // namespace treemarch
