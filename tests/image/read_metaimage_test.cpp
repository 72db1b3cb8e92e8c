#include "treemarch/image/read_metaimage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

template <class T>
const char* meta_type() {
  if constexpr (std::is_same_v<T, std::int8_t>) return "MET_CHAR";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "MET_UCHAR";
  if constexpr (std::is_same_v<T, std::int16_t>) return "MET_SHORT";
  if constexpr (std::is_same_v<T, std::uint16_t>) return "MET_USHORT";
  if constexpr (std::is_same_v<T, std::int32_t>) return "MET_INT";
  if constexpr (std::is_same_v<T, std::uint32_t>) return "MET_UINT";
  if constexpr (std::is_same_v<T, std::int64_t>) return "MET_LONG_LONG";
  if constexpr (std::is_same_v<T, std::uint64_t>) return "MET_ULONG_LONG";
  if constexpr (std::is_same_v<T, float>) return "MET_FLOAT";
  return "MET_DOUBLE";
}

std::string header(const std::string& type, const std::string& size = "2 3 4", const std::string& more = "",
                   const std::string& data = "LOCAL") {
  const auto dims = std::count(size.begin(), size.end(), ' ') + 1;
  return "ObjectType = Image\nNDims = " + std::to_string(dims) + "\nBinaryData = True\n" + more + "DimSize = " + size +
         "\nElementType = " + type + "\nElementDataFile = " + data + "\n";
}

Bytes deflated(const Bytes& plain) {
  Bytes out(compressBound(plain.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(plain.data()), plain.size());
  out.resize(size);
  return out;
}

template <class T>
class MetaTypes : public ::testing::Test {};
TYPED_TEST_SUITE(MetaTypes, SampleTypes);

TYPED_TEST(MetaTypes, LocalDetachedAndCompressed) {
  const TemporaryFolder folder;
  const std::vector<TypeParam> values = with_wide_values(counted<TypeParam>(24));
  const std::vector<std::int64_t> expected(values.begin(), values.end());
  const std::string type = meta_type<TypeParam>();
  for (const bool big_endian : {false, true}) {
    const std::string order = big_endian ? "BinaryDataByteOrderMSB = True\n" : "BinaryDataByteOrderMSB = False\n";
    const Bytes data = bytes_of_all(values, big_endian);
    EXPECT_EQ(labels_of(read<3>(folder.write("a.mha", header(type, "2 3 4", order) + data))), expected);
    folder.write("b.raw", data);
    EXPECT_EQ(labels_of(read<3>(folder.write("b.mhd", header(type, "2 3 4", order, "b.raw")))), expected);
    const Bytes packed = deflated(data);
    const std::string compressed =
        order + "CompressedData = True\nCompressedDataSize = " + std::to_string(packed.size()) + "\n";
    EXPECT_EQ(labels_of(read<3>(folder.write("c.mha", header(type, "2 3 4", compressed) + packed))), expected);
  }
}

TEST(MetaImage, GeometryIsLps) {
  const TemporaryFolder folder;
  // The rows of the matrix are the directions of the axes; left-handed, the last one sheared.
  const std::string place = "TransformMatrix = 0 1 0 -1 0 0 0 0.6 -0.8\nOffset = 5 6 7\nElementSpacing = 0.5 2 3\n";
  const auto frame = read<3>(folder.write("a.mha", header("MET_UCHAR", "2 3 4", place) + Bytes(24, '\1'))).frame;
  EXPECT_EQ(frame.space, "LPS");
  EXPECT_EQ(frame.origin, (Vec<3>{5, 6, 7}));
  const std::array<Vec<3>, 3> axes{{{0, 1, 0}, {-1, 0, 0}, {0, 0.6, -0.8}}};
  const Vec<3> spacing{0.5, 2, 3};
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(frame.spacing[c], spacing[c], 1e-12);
    for (int r = 0; r < 3; ++r) EXPECT_NEAR(frame.direction[c][r], axes[c][r], 1e-12);
  }
}

TEST(MetaImage, TwoAndFourDimensions) {
  const TemporaryFolder folder;
  const auto flat =
      read<2>(folder.write("a.mha", header("MET_UCHAR", "4 3", "ElementSpacing = 1 2\n") + Bytes(12, '\1')));
  EXPECT_EQ(flat.extent, (Coord<2>{4, 3}));
  EXPECT_EQ(flat.frame.spacing, (Vec<2>{1, 2}));
  EXPECT_EQ(flat.frame.space, "LP");
  const std::string moving = folder.write("b.mha", header("MET_UCHAR", "2 1 2 2") + Bytes("\1\2\3\4\5\6\7\10", 8));
  EXPECT_THAT(error_of(moving), HasSubstr("--volume N"));
  EXPECT_EQ(labels_of(read<3>(moving, {.volume = 1})), (std::vector<std::int64_t>{5, 6, 7, 8}));
}

TEST(MetaImage, BadFiles) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& content) { return error_of(folder.write("bad.mha", content)); };
  EXPECT_THAT(error(header("MET_UCHAR") + Bytes(20, '\1')), HasSubstr("cut short"));
  EXPECT_THAT(error(header("MET_UCHAR", "2 0 4") + Bytes(24, '\1')), HasSubstr("cannot be"));
  EXPECT_NE(error(header("MET_UCHAR", "2 -3 4") + Bytes(24, '\1')), "");
  EXPECT_THAT(error(header("MET_UCHAR", "2000 3000 4000") + Bytes(24, '\1')), HasSubstr("cut short"));
  EXPECT_NE(error(header("MET_NONSENSE") + Bytes(24, '\1')), "");
  EXPECT_THAT(error(header("MET_UCHAR", "2 2 2", "ElementNumberOfChannels = 3\n") + Bytes(24, '\1')),
              ::testing::AnyOf(HasSubstr("RGB"), HasSubstr("3 values")));
  EXPECT_NE(error(header("MET_UCHAR", "2 3 4", "ElementSpacing = 1 0 1\n") + Bytes(24, '\1')), "");
  EXPECT_NE(error(header("MET_UCHAR", "2 3 4", "ElementSpacing = 1 nan 1\n") + Bytes(24, '\1')), "");
  EXPECT_NE(error(header("MET_UCHAR", "2 3 4", "TransformMatrix = 1 0 0 2 0 0 0 0 1\n") + Bytes(24, '\1')), "");
  EXPECT_THAT(error("ObjectType = Image\nNDims = 3\n"), HasSubstr("ElementDataFile"));
  EXPECT_THAT(error_of(folder.write("lone.mhd", header("MET_UCHAR", "2 3 4", "", "gone.raw"))), HasSubstr("gone.raw"));
}

}  // namespace
}  // namespace treemarch
