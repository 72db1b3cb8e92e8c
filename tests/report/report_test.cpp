#include "treemarch/report/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/images.h"
#include "support/voxel_mesh.h"

namespace treemarch {
namespace {

Report example() {
  auto image = testing::noise_image<3>({4, 5, 6}, 3, 1);
  image.names = {"a", "b", "not \xff UTF-8"};
  const auto mesh = testing::voxel_mesh(image);
  Report report;
  report.version = version();
  report.options = {{"min-size", "2mm"}};
  describe_mesh(mesh, report);
  report.fidelity = measure_fidelity(image, mesh, 0, Execution(1));
  report.seconds = {{"tree", 1.5}, {"march", 1}, {"march", 2}};
  report.mesh_seconds = 5;
  report.peak_memory_bytes = peak_memory_bytes();
  report.quality.angles = {20, 150};
  return report;
}

TEST(Report, JsonHoldsWhatIsPromised) {
  const auto json = nlohmann::json::parse(to_json(example()));
  EXPECT_EQ(json["cells"]["hexahedron"], 120);
  EXPECT_EQ(json["quality"]["min_dihedral"], 20);
  EXPECT_EQ(json["quality"]["max_dihedral"], 150);
  EXPECT_EQ(json["seconds"]["mesh"], 5);
  EXPECT_EQ(json["seconds"]["march"], 3);
  EXPECT_GT(json["peak_memory_bytes"], 1000000);
  EXPECT_TRUE(json["lost_labels"].empty());
  EXPECT_EQ(json["options"]["min-size"], "2mm");
  EXPECT_EQ(json["version"], version());
  ASSERT_EQ(json["labels"].size(), 3);
  for (const auto& label : json["labels"])
    for (const char* key : {"label", "name", "voxels", "cells", "volume"}) EXPECT_TRUE(label.contains(key)) << key;
}

TEST(Report, TextNamesWhatWasLost) {
  Report report = example();
  EXPECT_NE(to_text(report).find("none lost"), std::string::npos);
  report.fidelity.labels[1].cells = 0;
  EXPECT_NE(to_text(report).find("lost: 7"), std::string::npos);
}

}  // namespace
}  // namespace treemarch
