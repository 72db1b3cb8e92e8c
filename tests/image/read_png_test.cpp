#include "treemarch/image/read_png.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

TEST(Png, SamplesAreKeptAsTheyAreAtAnyDepth) {
  const TemporaryFolder folder;
  const auto labels = [&](unsigned bits, const Bytes& row) {
    return labels_of(read<2>(folder.write("a.png", png_file(4, 1, bits, 0, {row}))));
  };
  EXPECT_EQ(labels(1, "\x50"), (std::vector<std::int64_t>{0, 1, 0, 1}));
  EXPECT_EQ(labels(2, "\x1b"), (std::vector<std::int64_t>{0, 1, 2, 3}));
  EXPECT_EQ(labels(4, "\x1f\x23"), (std::vector<std::int64_t>{1, 15, 2, 3}));
  EXPECT_EQ(labels(8, Bytes("\0\1\xff\7", 4)), (std::vector<std::int64_t>{0, 1, 255, 7}));
  EXPECT_EQ(labels(16, Bytes("\0\1\1\0\xff\xff\0\0", 8)), (std::vector<std::int64_t>{1, 256, 65535, 0}));
}

TEST(Png, FirstAxisRunsAlongRows) {
  const TemporaryFolder folder;
  const auto image = read<2>(folder.write("a.png", png_file(3, 2, 8, 0, {"abc", "def"})), {.spacing = {0.5}});
  EXPECT_EQ(image.extent, (Coord<2>{3, 2}));
  EXPECT_EQ(labels_of(image), (std::vector<std::int64_t>{'a', 'b', 'c', 'd', 'e', 'f'}));
  EXPECT_EQ(image.frame.spacing, (Vec<2>{0.5, 0.5}));
}

TEST(Png, ColoursAreErrors) {
  const TemporaryFolder folder;
  EXPECT_THAT(error_of(folder.write("a.png", png_file(1, 1, 8, 2, {"abc"}))), HasSubstr("RGB"));
  EXPECT_THAT(error_of(folder.write("a.png", png_file(1, 1, 8, 3, {"\1"}))), HasSubstr("palette"));
  EXPECT_THAT(error_of(folder.write("a.png", png_file(1, 1, 8, 4, {"ab"}))), HasSubstr("alpha"));
  EXPECT_THAT(error_of(folder.write("a.png", png_file(1, 1, 8, 6, {"abcd"}))), HasSubstr("RGB"));
}

TEST(Png, DamagedAnywhere) {
  const TemporaryFolder folder;
  const Bytes whole = png_file(4, 2, 8, 0, {"abcd", "efgh"});
  for (std::size_t n = 0; n + 12 < whole.size(); ++n)
    EXPECT_NE(error_of(folder.write("cut.png", whole.substr(0, n))), "") << n;
  Bytes huge = png_file(1'000'000, 1'000'000, 8, 0, {"abcd"});
  EXPECT_THAT(error_of(folder.write("huge.png", huge)), HasSubstr("cut short"));
}

}  // namespace
}  // namespace treemarch
