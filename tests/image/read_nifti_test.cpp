#include "treemarch/image/read_nifti.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// An oblique, left-handed and sheared affine, exact in float.
NiftiFile with_sform() {
  NiftiFile file;
  file.sform_code = 2;
  file.srow = {{{0.5, 0.25, 0, -10}, {-0.25, 2, 0.125, 20}, {0, 0.5, -1.5, 30}}};
  return file;
}

Bytes small_file(const NiftiFile& file) { return file.header() + bytes_of_all(counted<std::uint8_t>(24)); }

template <class T>
class NiftiTypes : public ::testing::Test {};
TYPED_TEST_SUITE(NiftiTypes, SampleTypes);

TYPED_TEST(NiftiTypes, BothVersionsByteOrdersAndCompressions) {
  const TemporaryFolder folder;
  const std::vector<TypeParam> values = with_wide_values(counted<TypeParam>(24));
  const std::vector<std::int64_t> expected(values.begin(), values.end());
  for (const int version : {1, 2})
    for (const bool big_endian : {false, true}) {
      NiftiFile file = with_sform();
      file.version = version;
      file.big_endian = big_endian;
      set_type<TypeParam>(file);
      const Bytes content = file.header() + bytes_of_all(values, big_endian);
      for (const std::string& path : {folder.write("a.nii", content), folder.write("a.nii.gz", gzip(content))}) {
        const auto image = read<3>(path);
        EXPECT_EQ(image.extent, (Coord<3>{2, 3, 4}));
        EXPECT_EQ(labels_of(image), expected);
      }
      file.two_files = true;
      folder.write("b.img", bytes_of_all(values, big_endian));
      EXPECT_EQ(labels_of(read<3>(folder.write("b.hdr", file.header()))), expected);
    }
}

TEST(Nifti, FullAffine) {
  const TemporaryFolder folder;
  for (const int version : {1, 2}) {
    NiftiFile file = with_sform();
    file.version = version;
    const auto image = read<3>(folder.write("a.nii", small_file(file)));
    EXPECT_EQ(image.frame.space, "RAS");
    EXPECT_TRUE(image.frame.has_spacing);
    // Centres of voxels are where the affine maps their indices.
    for (const Coord<3>& v : {Coord<3>{0, 0, 0}, Coord<3>{1, 0, 0}, Coord<3>{1, 2, 3}}) {
      Vec<3> inner;
      for (int d = 0; d < 3; ++d) inner[d] = (v[d] + 0.5) * image.frame.spacing[d];
      const Vec<3> world = to_world(image.frame, inner);
      for (std::size_t r = 0; r < 3; ++r) {
        const auto& row = file.srow[r];
        EXPECT_NEAR(world[r], row[0] * v[0] + row[1] * v[1] + row[2] * v[2] + row[3], 1e-12);
      }
    }
    for (int d = 0; d < 3; ++d) EXPECT_NEAR(norm(image.frame.direction[d]), 1, 2e-7);
  }
}

TEST(Nifti, QformWithoutSform) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.qform_code = 1;
  file.pixdim = {-1, 2, 3, 4, 1, 0, 0, 0};  // qfac -1: third axis reversed
  file.quatern = {0, 0, std::sqrt(0.5)};    // a quarter turn about z
  file.qoffset = {5, 6, 7};
  const auto image = read<3>(folder.write("a.nii", small_file(file)));
  const std::array<Vec<3>, 3> expected{{{0, 1, 0}, {-1, 0, 0}, {0, 0, -1}}};
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(image.frame.spacing[d], d + 2, 1e-6);
    EXPECT_NEAR(image.frame.origin[d], d + 5, 1e-6);
    for (int r = 0; r < 3; ++r) EXPECT_NEAR(image.frame.direction[d][r], expected[d][r], 1e-6);
  }
}

TEST(Nifti, SformBeforeQformWithAWarningWhereTheyDisagree) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.sform_code = 1;
  file.qform_code = 1;
  file.srow = {{{1, 0, 0, 5}, {0, 1, 0, 6}, {0, 0, 1, 7}}};
  file.qoffset = {5, 6, 7};
  EXPECT_THAT(warnings_of(folder.write("a.nii", small_file(file))), IsEmpty());
  file.qoffset = {5, 6, 8};
  const std::string path = folder.write("b.nii", small_file(file));
  EXPECT_THAT(warnings_of(path), ::testing::ElementsAre(HasSubstr("disagree")));
  EXPECT_EQ(read<3>(path).frame.origin[2], 7);
}

TEST(Nifti, NeitherFormGivesTheSpacingAloneAndAWarning) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.pixdim = {1, 2, 3, 4, 1, 0, 0, 0};
  file.qoffset = {9, 9, 9};  // not valid without its code
  const std::string path = folder.write("a.nii", small_file(file));
  EXPECT_THAT(warnings_of(path), ::testing::ElementsAre(HasSubstr("neither")));
  const auto frame = read<3>(path).frame;
  EXPECT_EQ(frame.spacing, (Vec<3>{2, 3, 4}));
  EXPECT_EQ(frame.origin, (Vec<3>{0, 0, 0}));
  EXPECT_EQ(frame.direction, Frame<3>::identity());
}

TEST(Nifti, UnitsBecomeMillimetres) {
  const TemporaryFolder folder;
  for (const auto& [units, scale] : {std::pair{1, 1000.0}, {2, 1.0}, {3, 0.001}, {0, 1.0}}) {
    NiftiFile file = with_sform();
    file.units = units;
    const auto frame = read<3>(folder.write("a.nii", small_file(file))).frame;
    EXPECT_NEAR(frame.origin[0], -10 * scale, 1e-9 * scale);
    EXPECT_NEAR(frame.spacing[2], std::hypot(0.125, 1.5) * scale, 1e-9 * scale);
  }
}

TEST(Nifti, TwoDimensions) {
  const TemporaryFolder folder;
  NiftiFile file = with_sform();
  file.srow = {{{0.5, 0, 0, 3}, {0, -2, 0, 4}, {0, 0, 1, 0}}};
  file.dim = {6, 4};
  const auto image = read<2>(folder.write("a.nii", small_file(file)));
  EXPECT_EQ(image.extent, (Coord<2>{6, 4}));
  EXPECT_EQ(image.frame.spacing, (Vec<2>{0.5, 2}));
  EXPECT_EQ(image.frame.origin, (Vec<2>{3, 4}));
  file.srow[2][0] = 0.1;
  EXPECT_THAT(warnings_of(folder.write("b.nii", small_file(file))), ::testing::ElementsAre(HasSubstr("tilted")));
}

TEST(Nifti, Volumes) {
  const TemporaryFolder folder;
  NiftiFile file = with_sform();
  file.dim = {2, 2, 2, 1, 1};
  EXPECT_EQ(read<3>(folder.write("one.nii", small_file(file))).extent, (Coord<3>{2, 2, 2}));
  file.dim = {2, 2, 2, 3};
  file.pixdim[4] = 250;
  file.units = 2 + 16;  // mm, ms
  const std::string path = folder.write("three.nii", small_file(file));
  EXPECT_THAT(error_of(path), HasSubstr("--volume N"));
  const auto all = counted<std::uint8_t>(24);
  EXPECT_EQ(labels_of(read<3>(path, {.volume = 2})), std::vector<std::int64_t>(all.begin() + 16, all.end()));
  EXPECT_THAT(error_of(path, {.volume = 3}, ErrorKind::usage), HasSubstr("0 to 2"));
  const auto moving = read<4>(path, {.space_time = true});
  EXPECT_EQ(moving.extent, (Coord<4>{2, 2, 2, 3}));
  EXPECT_EQ(labels_of(moving), std::vector<std::int64_t>(all.begin(), all.end()));
  EXPECT_EQ(moving.frame.space, "RAST");
  EXPECT_NEAR(moving.frame.spacing[3], 0.25, 1e-9);
}

TEST(Nifti, Scaling) {
  const TemporaryFolder folder;
  NiftiFile file = with_sform();
  file.slope = 2;
  file.intercept = -3;
  std::vector<std::int64_t> expected;
  for (const std::uint8_t v : counted<std::uint8_t>(24)) expected.push_back(2 * v - 3);
  EXPECT_EQ(labels_of(read<3>(folder.write("a.nii", small_file(file)))), expected);
  file.slope = 0.5;
  const std::string path = folder.write("b.nii", small_file(file));
  EXPECT_THAT(error_of(path), HasSubstr("--threshold"));
  const auto image = read<3>(path, {.threshold = -2.5});
  const auto samples = counted<std::uint8_t>(24);
  for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(labels_of(image)[i], 0.5 * samples[i] - 3 >= -2.5 ? 1 : 0);
}

TEST(Nifti, ThePlaceOfTheData) {
  const TemporaryFolder folder;
  NiftiFile file = with_sform();
  file.vox_offset = 400;
  const auto values = counted<std::uint8_t>(24);
  Bytes content = file.header();
  content.resize(400, '\xee');
  for (const bool compressed : {false, true}) {
    const Bytes whole = content + bytes_of_all(values);
    const auto image = read<3>(folder.write("a.nii", compressed ? gzip(whole) : whole));
    EXPECT_EQ(labels_of(image), std::vector<std::int64_t>(values.begin(), values.end()));
  }
  file.vox_offset = 1e6;
  EXPECT_THAT(error_of(folder.write("b.nii", small_file(file))), HasSubstr("vox_offset"));
}

TEST(Nifti, BadHeaders) {
  const TemporaryFolder folder;
  const auto error = [&](const NiftiFile& file) { return error_of(folder.write("bad.nii", small_file(file))); };
  NiftiFile file = with_sform();
  file.dim = {2, 0, 4};
  EXPECT_THAT(error(file), HasSubstr("cannot be"));
  file.dim = {2, -3, 4};
  EXPECT_THAT(error(file), HasSubstr("cannot be"));
  file.dim = {30000, 30000, 30000};
  EXPECT_THAT(error(file), HasSubstr("cut short"));
  file.version = 2;
  file.dim = {std::int64_t{1} << 40, 1 << 20, 1 << 20};
  EXPECT_THAT(error(file), HasSubstr("cannot be"));
  file.dim = {1 << 30, 1 << 30, 1 << 30};
  EXPECT_THAT(error(file), HasSubstr("cannot be"));
  for (const int type : {0, 1, 32, 1536, 1792, 999}) {
    NiftiFile other = with_sform();
    other.datatype = type;
    EXPECT_THAT(error(other), HasSubstr("data type"));
  }
  for (const int type : {128, 2304}) {
    NiftiFile colored = with_sform();
    colored.datatype = type;
    EXPECT_THAT(error(colored), HasSubstr("RGB"));
  }
  for (const double spacing : {0.0, kNaN, std::numeric_limits<double>::infinity()}) {
    NiftiFile flat;
    flat.pixdim[2] = spacing;
    EXPECT_THAT(error(flat), HasSubstr("spacing"));
  }
  NiftiFile singular = with_sform();
  singular.srow[2] = {0.5, 0.25, 0, 0};  // twice the first row
  EXPECT_THAT(error(singular), HasSubstr("singular"));
  singular.srow[2] = {0, 0, kNaN, 0};
  EXPECT_THAT(error(singular), HasSubstr("not finite"));
  singular.srow = {{{0.5, 0, 0, 0}, {0, 0.5, 0, 0}, {0, 0, 0, 0}}};
  EXPECT_THAT(error(singular), HasSubstr("spacing"));
}

TEST(Nifti, TruncatedAnywhereInPlainAndCompressedFiles) {
  const TemporaryFolder folder;
  for (const int version : {1, 2}) {
    NiftiFile file = with_sform();
    file.version = version;
    const Bytes whole = small_file(file), packed = gzip(whole);
    for (std::size_t n = 0; n < whole.size(); n += n < 350 ? 7 : 3)
      EXPECT_THAT(error_of(folder.write("cut.nii", whole.substr(0, n))), ::testing::Not(IsEmpty())) << n;
    // Without the last bytes (end mark and checksum) the samples may still be whole.
    const auto samples = counted<std::uint8_t>(24);
    for (std::size_t n = 0; n < packed.size(); n += 3) {
      const std::string path = folder.write("cut.nii.gz", packed.substr(0, n));
      if (!error_of(path).empty()) continue;
      EXPECT_GE(n + 16, packed.size());
      EXPECT_EQ(labels_of(read<3>(path)), std::vector<std::int64_t>(samples.begin(), samples.end()));
    }
  }
  EXPECT_THAT(error_of(folder.write("cut.nii", small_file(with_sform()).substr(0, 370))), HasSubstr("18 of 24"));
}

TEST(Nifti, DamagedCompressionIsNoticedByItsChecksum) {
  const TemporaryFolder folder;
  Bytes packed = gzip(small_file(with_sform()));
  packed[packed.size() - 6] ^= 1;
  EXPECT_THAT(error_of(folder.write("bad.nii.gz", packed)), HasSubstr("damaged"));
}

TEST(Nifti, MissingPartner) {
  const TemporaryFolder folder;
  NiftiFile file = with_sform();
  file.two_files = true;
  EXPECT_THAT(error_of(folder.write("alone.hdr", file.header())), HasSubstr("alone.img"));
}

}  // namespace
}  // namespace treemarch
