#include "treemarch/image/read_tiff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tiffio.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

template <class T>
TiffOptions options_for() {
  TiffOptions o;
  o.bits = 8 * sizeof(T);
  o.format = std::is_floating_point_v<T> ? 3 : std::is_signed_v<T> ? 2 : 1;
  return o;
}

template <class T>
class TiffTypes : public ::testing::Test {};
TYPED_TEST_SUITE(TiffTypes, SampleTypes);

TYPED_TEST(TiffTypes, StripsTilesByteOrdersCompressionsAndPages) {
  const TemporaryFolder folder;
  constexpr unsigned kWidth = 37, kHeight = 21;
  std::vector<TypeParam> values(kWidth * kHeight);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<TypeParam>(i / 8 % 90);
  values = with_wide_values(values);
  std::vector<std::int64_t> expected(values.begin(), values.end());
  const std::string path = folder.path("a.tif");
  for (const bool big_endian : {false, true})
    for (const std::uint16_t compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE})
      for (const std::uint32_t tile : {0U, 16U}) {
        TiffOptions o = options_for<TypeParam>();
        o.big_endian = big_endian;
        o.compression = compression;
        o.tile = tile;
        write_tiff(path, kWidth, kHeight, {bytes_of_all(values)}, o);
        const auto image = read<2>(path);
        EXPECT_EQ(image.extent, (Coord<2>{kWidth, kHeight}));
        EXPECT_EQ(labels_of(image), expected);
        EXPECT_FALSE(image.frame.has_spacing);
      }
  write_tiff(path, kWidth, kHeight, {bytes_of_all(values), bytes_of_all(values)}, options_for<TypeParam>());
  const auto stack = read<3>(path, {.spacing = {1, 2, 3}});
  expected.insert(expected.end(), values.begin(), values.end());
  EXPECT_EQ(stack.extent, (Coord<3>{kWidth, kHeight, 2}));
  EXPECT_EQ(labels_of(stack), expected);
  EXPECT_EQ(stack.frame.spacing, (Vec<3>{1, 2, 3}));
}

TEST(Tiff, SamplesOfLessThanAByte) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a.tif");
  TiffOptions o;
  o.bits = 4;
  write_tiff(path, 3, 2, {Bytes("\x12\x30\x4f\x60", 4)}, o);
  EXPECT_EQ(labels_of(read<2>(path)), (std::vector<std::int64_t>{1, 2, 3, 4, 15, 6}));
  o.bits = 1;
  write_tiff(path, 9, 1, {Bytes("\xa5\x80", 2)}, o);
  EXPECT_EQ(labels_of(read<2>(path)), (std::vector<std::int64_t>{1, 0, 1, 0, 0, 1, 0, 1, 1}));
}

TEST(Tiff, ColoursAreErrors) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a.tif");
  TiffOptions o;
  o.photometric = PHOTOMETRIC_PALETTE;
  write_tiff(path, 3, 2, {Bytes(6, '\1')}, o);
  EXPECT_THAT(error_of(path), HasSubstr("palette"));
  o.photometric = PHOTOMETRIC_RGB;
  o.samples_per_pixel = 3;
  write_tiff(path, 3, 2, {Bytes(18, '\1')}, o);
  EXPECT_THAT(error_of(path), HasSubstr("RGB"));
  o.photometric = PHOTOMETRIC_MINISBLACK;
  write_tiff(path, 3, 2, {Bytes(18, '\1')}, o);
  EXPECT_THAT(error_of(path), HasSubstr("3 values"));
}

TEST(Tiff, Truncated) {
  const TemporaryFolder folder;
  const std::string path = folder.path("a.tif");
  write_tiff(path, 30, 20, {Bytes(600, '\1'), Bytes(600, '\2')}, {});
  std::string whole;
  {
    std::FILE* f = std::fopen(path.c_str(), "rb");
    whole.resize(std::filesystem::file_size(path));
    ASSERT_EQ(std::fread(whole.data(), 1, whole.size(), f), whole.size());
    std::fclose(f);
  }
  for (std::size_t n = 0; n + 8 < whole.size(); n += 50)
    EXPECT_NE(error_of(folder.write("cut.tif", whole.substr(0, n))), "") << n << " of " << whole.size();
}

}  // namespace
}  // namespace treemarch
