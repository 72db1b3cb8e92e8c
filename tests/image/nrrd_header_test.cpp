#include "treemarch/image/nrrd_header.h"

#include <gtest/gtest.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;

TEST(NrrdHeader, FieldsKeysAndLength) {
  const TemporaryFolder folder;
  const std::string text = "NRRD0005\r\n# comment: no field\r\nType: uchar\r\nkey:=a: value\r\n\r\n";
  const NrrdHeader header = read_nrrd_header(folder.write("a.nrrd", text + "data: none"));
  EXPECT_EQ(header.field("type"), "uchar");
  EXPECT_EQ(header.field("data"), "");
  EXPECT_EQ(header.fields.size(), 1U);
  ASSERT_EQ(header.keys.size(), 1U);
  EXPECT_EQ(header.keys[0].second, "a: value");
  EXPECT_EQ(header.bytes, text.size());
}

TEST(NrrdHeader, GeometryKeepsTheOrderOfAxes) {
  NrrdHeader header;
  header.fields = {{"dimension", "3"},
                   {"sizes", "2 5 7"},
                   {"kinds", "list domain ???"},
                   {"space directions", "none ( 1 , 2 ) (+3e0,-4)"},
                   {"space origin", "(5,6)"}};
  const NrrdGeometry g = nrrd_geometry("file", header);
  ASSERT_EQ(g.axes.size(), 3U);
  EXPECT_EQ(g.axes[1].size, 5);
  EXPECT_EQ(g.axes[0].kind, "list");
  EXPECT_EQ(g.axes[2].kind, "");
  EXPECT_TRUE(g.axes[0].direction.empty());
  EXPECT_EQ(g.axes[1].direction, (std::vector<double>{1, 2}));
  EXPECT_EQ(g.axes[2].direction, (std::vector<double>{3, -4}));
  EXPECT_EQ(g.origin, (std::vector<double>{5, 6}));
}

TEST(NrrdHeader, FieldsThatDoNotFitAreErrors) {
  for (const auto& [field, value] : {std::pair{"dimension", "2"},
                                     {"kinds", "domain domain"},
                                     {"spacings", "1 1"},
                                     {"spacings", "1 1 1x"},
                                     {"space directions", "(1,0,0) (0,1,0)"},
                                     {"space directions", "(1,0,0) (0,1,0) (0,0,1"},
                                     {"space directions", "1 0 0"},
                                     {"space origin", "(0,0,0) (1,1,1)"}}) {
    NrrdHeader header;
    header.fields = {{field, value}, {"dimension", "3"}, {"sizes", "2 5 7"}};
    EXPECT_THROW(nrrd_geometry("file", header), Error) << field << ": " << value;
  }
}

}  // namespace
}  // namespace treemarch
