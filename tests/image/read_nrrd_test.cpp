#include "treemarch/image/read_nrrd.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

template <class T>
const char* nrrd_type() {
  if constexpr (std::is_same_v<T, std::int8_t>) return "int8";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "uchar";
  if constexpr (std::is_same_v<T, std::int16_t>) return "short";
  if constexpr (std::is_same_v<T, std::uint16_t>) return "uint16";
  if constexpr (std::is_same_v<T, std::int32_t>) return "int";
  if constexpr (std::is_same_v<T, std::uint32_t>) return "uint32_t";
  if constexpr (std::is_same_v<T, std::int64_t>) return "int64";
  if constexpr (std::is_same_v<T, std::uint64_t>) return "unsigned long long";
  if constexpr (std::is_same_v<T, float>) return "float";
  return "double";
}

std::string header(const std::string& type, const std::string& encoding, const std::string& more = "",
                   const std::string& sizes = "2 3 4") {
  const auto dims = std::count(sizes.begin(), sizes.end(), ' ') + 1;
  return "NRRD0004\n# a comment\ntype: " + type + "\ndimension: " + std::to_string(dims) + "\nsizes: " + sizes +
         "\nencoding: " + encoding + "\n" + more;
}

template <class T>
class NrrdTypes : public ::testing::Test {};
TYPED_TEST_SUITE(NrrdTypes, SampleTypes);

TYPED_TEST(NrrdTypes, EncodingsAndByteOrders) {
  const TemporaryFolder folder;
  const std::vector<TypeParam> values = with_wide_values(counted<TypeParam>(24));
  const std::vector<std::int64_t> expected(values.begin(), values.end());
  const std::string type = nrrd_type<TypeParam>();
  for (const bool big_endian : {false, true}) {
    const std::string endian = big_endian ? "endian: big\n" : "endian: little\n";
    const Bytes data = bytes_of_all(values, big_endian);
    EXPECT_EQ(labels_of(read<3>(folder.write("raw.nrrd", header(type, "raw", endian) + "\n" + data))), expected);
    EXPECT_EQ(labels_of(read<3>(folder.write("gz.nrrd", header(type, "gzip", endian) + "\n" + gzip(data)))), expected);
    folder.write("detached.raw", data);
    EXPECT_EQ(labels_of(read<3>(folder.write("d.nhdr", header(type, "raw", endian + "data file: detached.raw\n")))),
              expected);
    folder.write("detached.raw.gz", gzip(data));
    EXPECT_EQ(labels_of(read<3>(folder.write("e.nhdr", header(type, "gz", endian + "data file: detached.raw.gz\n")))),
              expected);
  }
  std::ostringstream text;
  text.precision(17);
  for (const auto v : values) text << +v << ' ';
  EXPECT_EQ(labels_of(read<3>(folder.write("ascii.nrrd", header(type, "ascii") + "\n" + text.str()))), expected);
}

TEST(Nrrd, TheSpaceThatTheFileDeclares) {
  const TemporaryFolder folder;
  const Bytes data(24, '\1');
  // Oblique, left-handed and sheared.
  const std::string place = "space directions: (0.5,-0.25,0) (0.25,2,0.5) (0,0.125,-1.5)\nspace origin: (-10,20,30)\n";
  for (const auto& [space, letters] : {std::pair{"right-anterior-superior", "RAS"},
                                       {"left-anterior-superior", "LAS"},
                                       {"left-posterior-superior", "LPS"},
                                       {"LPS", "LPS"},
                                       {"RAS", "RAS"},
                                       {"scanner-xyz", ""},
                                       {"3D-left-handed", ""}}) {
    const auto image = read<3>(
        folder.write("a.nrrd", header("uchar", "raw", "space: " + std::string(space) + "\n" + place) + "\n" + data));
    EXPECT_EQ(image.frame.space, letters);
    EXPECT_EQ(image.frame.origin, (Vec<3>{-10, 20, 30}));
    const std::array<Vec<3>, 3> axes{{{0.5, -0.25, 0}, {0.25, 2, 0.5}, {0, 0.125, -1.5}}};
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(image.frame.direction[c][r] * image.frame.spacing[c], axes[c][r], 1e-12) << space;
  }
}

TEST(Nrrd, SpacingsAlone) {
  const TemporaryFolder folder;
  const Bytes data(24, '\1');
  const auto frame =
      read<3>(folder.write("a.nrrd", header("uchar", "raw", "spacings: 0.5 0.5 3\n") + "\n" + data)).frame;
  EXPECT_EQ(frame.spacing, (Vec<3>{0.5, 0.5, 3}));
  EXPECT_TRUE(frame.has_spacing);
  EXPECT_EQ(frame.space, "");
  const std::string path = folder.write("b.nrrd", header("uchar", "raw") + "\n" + data);
  EXPECT_FALSE(read<3>(path).frame.has_spacing);
  EXPECT_EQ(read<3>(path, {.spacing = {1, 2, 3}}).frame.spacing, (Vec<3>{1, 2, 3}));
}

TEST(Nrrd, UnitsBecomeMillimetres) {
  const TemporaryFolder folder;
  const Bytes data(24, '\1');
  const auto scaled = [&](const std::string& fields) {
    return read<3>(folder.write("a.nrrd", header("uchar", "raw", fields) + "\n" + data)).frame;
  };
  const auto space = scaled(
      "space dimension: 3\nspace units: \"um\" \"um\" \"um\"\nspace directions: (2,0,0) (0,2,0) (0,0,4)\n"
      "space origin: (1000,0,0)\n");
  EXPECT_NEAR(space.spacing[2], 0.004, 1e-15);
  EXPECT_NEAR(space.origin[0], 1, 1e-12);
  EXPECT_NEAR(scaled("spacings: 2 2 2\nunits: \"cm\" \"mm\" \"m\"\n").spacing[0], 20, 1e-12);
}

TEST(Nrrd, TwoDimensionsAndVolumes) {
  const TemporaryFolder folder;
  const Bytes data("\1\2\3\4\5\6\7\10", 8);
  EXPECT_EQ(read<2>(folder.write("a.nrrd", header("uchar", "raw", "", "4 2") + "\n" + data)).extent, (Coord<2>{4, 2}));
  const std::string space = "space: RAS\nspace directions: (1,0,0) (0,1,0) (0,0,1) none\nkinds: domain domain domain ";
  const std::string time = folder.write("t.nrrd", header("uchar", "raw", space + "time\n", "2 1 2 2") + "\n" + data);
  EXPECT_THAT(error_of(time), HasSubstr("--volume N"));
  EXPECT_EQ(labels_of(read<3>(time, {.volume = 1})), (std::vector<std::int64_t>{5, 6, 7, 8}));
  const std::string last = folder.write("l.nrrd", header("uchar", "raw", space + "list\n", "2 1 2 2") + "\n" + data);
  EXPECT_EQ(labels_of(read<3>(last, {.volume = 1})), (std::vector<std::int64_t>{5, 6, 7, 8}));
  const std::string layers =
      header("uchar", "raw",
             "space: RAS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\n",
             "2 2 1 2") +
      "\n" + data;
  EXPECT_EQ(labels_of(read<3>(folder.write("f.nrrd", layers), {.volume = 1})), (std::vector<std::int64_t>{2, 4, 6, 8}));
  EXPECT_EQ(labels_of(read<4>(folder.write("f.nrrd", layers), {.space_time = true})),
            (std::vector<std::int64_t>{1, 3, 5, 7, 2, 4, 6, 8}));
}

TEST(Nrrd, NamesOfSegments) {
  const TemporaryFolder folder;
  const std::string names =
      "Segment0_LabelValue:=3\nSegment0_Name:=left lung\nSegment1_LabelValue:=1\nSegment1_Name:=liver\n";
  const auto image =
      read<3>(folder.write("a.seg.nrrd", header("uchar", "raw", names, "2 2 1") + "\n" + Bytes("\0\1\3\1", 4)));
  EXPECT_EQ(image.names, (std::vector<std::string>{"", "liver", "left lung"}));
}

TEST(Nrrd, BadFiles) {
  const TemporaryFolder folder;
  const Bytes data(24, '\1');
  const auto error = [&](const std::string& content) { return error_of(folder.write("bad.nrrd", content)); };
  EXPECT_THAT(error(header("uchar", "raw") + "\n" + data.substr(0, 20)), HasSubstr("cut short"));
  EXPECT_NE(error(header("uchar", "gzip") + "\n" + gzip(data).substr(0, 12)), "");
  EXPECT_THAT(error(header("uchar", "raw", "", "2 3 0") + "\n" + data), HasSubstr("cannot be"));
  EXPECT_THAT(error(header("uchar", "raw", "", "2 3 -4") + "\n" + data), HasSubstr("cannot be"));
  EXPECT_THAT(error(header("uchar", "raw", "", "2000 3000 4000") + "\n" + data), HasSubstr("cut short"));
  EXPECT_THAT(error(header("uchar", "gzip", "", "2000000 3000000 4000000") + "\n" + gzip(data)),
              HasSubstr("cannot be"));
  EXPECT_THAT(error(header("uchar", "raw", "spacings: 1 nan 1\n") + "\n" + data), HasSubstr("not a number"));
  EXPECT_THAT(error(header("uchar", "raw", "spacings: 1 0 1\n") + "\n" + data), HasSubstr("spacing"));
  EXPECT_THAT(error(header("uchar", "raw", "space: RAS\nspace directions: (1,0,0) (2,0,0) (0,0,1)\n") + "\n" + data),
              HasSubstr("singular"));
  EXPECT_THAT(error(header("uchar", "raw", "space: RAS\nspace directions: (1,0,0) (2,x,0) (0,0,1)\n") + "\n" + data),
              HasSubstr("'x'"));
  EXPECT_THAT(error(header("uchar", "raw", "kinds: RGB-color domain domain\n", "3 2 4") + "\n" + data),
              HasSubstr("3 values a voxel"));
  EXPECT_NE(error("NRRD0004\ntype: uchar\n"), "");
  EXPECT_NE(error("NRRD0004\n"), "");
  EXPECT_NE(error(header("block", "raw") + "\n" + data), "");
  EXPECT_NE(error(header("uchar", "nonsense") + "\n" + data), "");
  EXPECT_THAT(error_of(folder.write("lone.nhdr", header("uchar", "raw", "data file: gone.raw\n"))),
              HasSubstr("gone.raw"));
}

}  // namespace
}  // namespace treemarch
