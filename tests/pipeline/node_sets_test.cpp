#include "treemarch/pipeline/node_sets.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/meshes.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

class NodeSets : public ::testing::Test {
 protected:
  NodeSets() { frame.origin = {10.5, -19.5, 0.5}, frame.direction[0] = {0, 1, 0}, frame.direction[1] = {1, 0, 0}; }
  std::vector<NodeSet> find(const std::vector<std::string>& texts) {
    return find_node_sets(texts, mesh, frame, execution);
  }
  /// The vertices for which `is_inside` holds of their place in the world.
  template <class Inside>
  void expect_set(const std::string& text, const Inside& is_inside) {
    std::vector<VertexId> expected;
    for (std::size_t v = 0; v < mesh.points.size(); ++v)
      if (is_inside(to_world(frame, mesh.points[v]))) expected.push_back(static_cast<VertexId>(v));
    ASSERT_FALSE(expected.empty()) << text;
    EXPECT_EQ(find({"a=" + text}).at(0).vertices, expected) << text;
  }
  // Voxels from (10, -20, 0) on, the first two axes exchanged.
  Mesh<3> mesh = testing::box_mesh<3>({4, 3, 2}, [](const Coord<3>&) { return 1; });
  Frame<3> frame;
  Execution execution{2};
};

TEST_F(NodeSets, FindWhatTheyDescribeInTheWorld) {
  expect_set("box:10,-20,0,11,-18,2", [](const Vec<3>& x) { return x[0] < 11.5 && x[1] < -17.5; });
  expect_set("plane:0,0,1,2", [](const Vec<3>& x) { return x[2] > 1.5; });
  expect_set("plane:0,0,-5,-10", [](const Vec<3>& x) { return x[2] > 1.5; });
  expect_set("plane:1,1,0,-9,0.8", [](const Vec<3>& x) { return std::abs(x[0] + x[1] + 9) < 1.5; });
  EXPECT_EQ(find({"a=nodes:7,0-2,2"})[0].vertices, (std::vector<VertexId>{0, 1, 2, 7}));
}

TEST_F(NodeSets, KeepTheirNamesAndOrder) {
  const auto sets = find({"low-end=nodes:1", "top.2=nodes:3"});
  EXPECT_EQ(sets.at(0).name, "low-end");
  EXPECT_EQ(sets.at(1).name, "top.2");
  EXPECT_TRUE(find({}).empty());
}

TEST_F(NodeSets, RefuseWhatMakesNoSense) {
  for (const char* text : {"",
                           "a",
                           "a=",
                           "=nodes:1",
                           "a=nodes",
                           "a=nodes:",
                           "a=nodes:x",
                           "a=nodes:3-1",
                           "a=nodes:-1",
                           "a=nodes:1-2-3",
                           "a=ball:0,0,0,1",
                           "a=box:0,0,0,1,1",
                           "a=box:0,0,0,1,1,x",
                           "a=box:1,0,0,0,1,1",
                           "a=plane:0,0,0,1",
                           "a=plane:0,0,1",
                           "a=plane:0,0,1,2,3,4",
                           "a b=nodes:1",
                           "a\"=nodes:1",
                           "partition=nodes:1"}) {
    EXPECT_THROW(check_node_sets({text}, 3), Error) << text;
    EXPECT_THROW(find({text}), Error) << text;
  }
  EXPECT_THROW(check_node_sets({"a=nodes:1", "a=nodes:2"}, 3), Error);
  EXPECT_THROW(find({"a=nodes:60"}), Error) << "beyond the mesh";
  EXPECT_THROW(find({"a=plane:0,0,1,7"}), Error) << "empty";
  EXPECT_NO_THROW(check_node_sets({"a=box:0,0,1,1"}, 2));
}

}  // namespace
}  // namespace treemarch
