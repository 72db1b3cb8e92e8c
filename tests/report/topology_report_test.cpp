#include "treemarch/report/topology_report.h"

#include <gtest/gtest.h>

#include "support/images.h"
#include "support/voxel_mesh.h"
#include "treemarch/report/fidelity.h"

namespace treemarch {
namespace {

template <int Dim>
TopologyReport report_on(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::int64_t min_component = 8) {
  return *measure_fidelity(image, mesh, 0, Execution(2), min_component).topology;
}

TEST(topology_report, the_mesh_that_repeats_the_image_breaks_nothing) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    const auto image = testing::noise_image<3>({9, 8, 7}, 2 + static_cast<int>(seed), seed);
    const TopologyReport t = report_on(image, testing::voxel_mesh(image));
    EXPECT_FALSE(t.breached()) << t.breach();
    EXPECT_EQ(std::ssize(t.pinches), t.image_pinches);  // everywhere as in the image
    EXPECT_GT(t.image_pinches, 0);
    EXPECT_TRUE(t.broken_small.empty());
    EXPECT_EQ(std::ssize(t.separated), t.contacts);  // cells that share an edge are no component
  }
}

/// A bar of 9 voxels along the first axis.
LabelImage<3> bar() {
  std::vector<std::int32_t> values(11 * 3 * 3);
  for (std::size_t x = 1; x <= 9; ++x) values[(1 * 3 + 1) * 11 + x] = 5;
  Frame<3> frame;
  frame.spacing = {2, 2, 2};
  frame.origin = {100, 0, 0};
  return make_label_image(Coord<3>{11, 3, 3}, values, frame);
}

TEST(topology_report, names_what_is_split_and_lost) {
  const auto image = bar();
  Mesh<3> mesh = testing::voxel_mesh(image);
  mesh.blocks[0].materials[(1 * 3 + 1) * 11 + 5] = 0;
  TopologyReport t = report_on(image, mesh);
  ASSERT_EQ(t.broken.size(), 1U);
  EXPECT_FALSE(t.broken[0].lost);
  EXPECT_EQ(t.broken[0].label, 5);
  EXPECT_EQ(t.broken[0].voxels, 9);
  EXPECT_EQ(t.broken[0].place, (Vec<3>{102, 2, 2}));
  EXPECT_NE(t.breach().find("1 split component"), std::string::npos);
  t = report_on(image, mesh, 10);
  EXPECT_FALSE(t.breached());
  EXPECT_EQ(t.broken_small.size(), 1U);
  for (std::size_t x = 1; x <= 9; ++x) mesh.blocks[0].materials[(1 * 3 + 1) * 11 + x] = 0;
  t = report_on(image, mesh, 10);  // the label's last component counts whatever its size
  ASSERT_EQ(t.broken.size(), 1U);
  EXPECT_TRUE(t.broken[0].lost);
}

TEST(topology_report, tells_pinches_that_the_image_has_from_those_it_has_not) {
  const auto image = bar();
  Mesh<3> mesh = testing::voxel_mesh(image);
  mesh.blocks[0].materials[(2 * 3 + 2) * 11 + 5] = 1;  // touches the bar along an edge
  const TopologyReport t = report_on(image, mesh);
  ASSERT_FALSE(t.pinches.empty());
  for (const PinchPlace& p : t.pinches) EXPECT_FALSE(p.in_image);
  EXPECT_TRUE(t.breached());
}

TEST(topology_report, lists_contacts_that_were_parted) {
  std::vector<std::int32_t> values(6 * 6);
  for (const int i : {7, 8, 13, 14, 21, 22, 27, 28})
    values[static_cast<std::size_t>(i)] = 3;  // two squares, one corner
  const auto image = make_label_image(Coord<2>{6, 6}, values);
  const Mesh<2> mesh = testing::voxel_mesh(image);
  const TopologyReport t = report_on(image, mesh);
  EXPECT_EQ(t.contacts, 1);
  ASSERT_EQ(t.separated.size(), 1U);
  EXPECT_EQ(t.separated[0].voxels, 4);
  EXPECT_EQ(t.separated[0].place, (Vec<3>{2.5, 2.5, 0}));
}

}  // namespace
}  // namespace treemarch
