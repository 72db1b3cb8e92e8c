#include "treemarch/image/read_dicom.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

/// Slice k of a series along z, with labels that tell the slice.
DicomSlice slice_at(double z, std::uint16_t first_label) {
  DicomSlice s;
  s.position = {10, 20, z};
  for (std::uint16_t i = 0; i < 6; ++i) s.values.push_back(static_cast<std::uint16_t>(first_label + i));
  return s;
}

TEST(Dicom, SeriesIsSortedByPosition) {
  const TemporaryFolder folder;
  // Names in another order than places.
  folder.write("s/c", dicom_file(slice_at(-3, 1)));
  folder.write("s/a", dicom_file(slice_at(-0.5, 11)));
  folder.write("s/b", dicom_file(slice_at(2, 21)));
  folder.write("s/notes.txt", "not an image");
  const auto image = read<3>(folder.path("s"));
  EXPECT_EQ(image.extent, (Coord<3>{3, 2, 3}));
  std::vector<std::int64_t> expected;
  for (const int first : {1, 11, 21})
    for (int i = 0; i < 6; ++i) expected.push_back(first + i);
  EXPECT_EQ(labels_of(image), expected);
  EXPECT_EQ(image.frame.space, "LPS");
  EXPECT_NEAR(image.frame.spacing[2], 2.5, 1e-12);
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(image.frame.origin[r], (Vec<3>{10, 20, -3}[r]), 1e-12);
}

TEST(Dicom, ObliqueAndTiltedSeries) {
  const TemporaryFolder folder;
  for (int k = 0; k < 3; ++k) {
    DicomSlice s = slice_at(0, 1);
    s.orientation = {0, 1, 0, 0, 0, -1};  // rows along y, columns along -z: normal along -x
    s.position = {-2.0 * k, 0.5 * k, 7};  // and shifted along y from slice to slice: a gantry tilt
    s.row_spacing = 3;                    // distance between rows: along the columns
    s.column_spacing = 0.25;
    folder.write("s/" + std::to_string(k), dicom_file(s));
  }
  const auto frame = read<3>(folder.path("s")).frame;
  const std::array<Vec<3>, 3> axes{{{0, 0.25, 0}, {0, 0, -3}, {-2, 0.5, 0}}};
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) EXPECT_NEAR(frame.direction[c][r] * frame.spacing[c], axes[c][r], 1e-9);
}

TEST(Dicom, OneFile) {
  const TemporaryFolder folder;
  const auto image = read<3>(folder.write("one.dcm", dicom_file(slice_at(0, 1))));
  EXPECT_EQ(image.extent, (Coord<3>{3, 2, 1}));
}

TEST(Dicom, Rescaling) {
  const TemporaryFolder folder;
  DicomSlice s = slice_at(0, 1);
  s.slope = "2";
  s.intercept = "-100";
  EXPECT_EQ(labels_of(read<3>(folder.write("one.dcm", dicom_file(s)))),
            (std::vector<std::int64_t>{-98, -96, -94, -92, -90, -88}));
  s.slope = "0.5";
  EXPECT_THAT(error_of(folder.write("half.dcm", dicom_file(s))), HasSubstr("--threshold"));
}

TEST(Dicom, SeveralSeriesAreListed) {
  const TemporaryFolder folder;
  for (int k = 0; k < 3; ++k) {
    DicomSlice s = slice_at(k, 1);
    s.series = k == 2 ? "9.8.7" : "1.2.3";
    folder.write("s/" + std::to_string(k), dicom_file(s));
  }
  EXPECT_THAT(error_of(folder.path("s")), ::testing::AllOf(HasSubstr("1.2.3 (2 files)"), HasSubstr("9.8.7 (1 file)")));
}

TEST(Dicom, SlicesThatMakeNoGridAreErrors) {
  const auto error_with = [](const std::function<void(std::vector<DicomSlice>&)>& change) {
    const TemporaryFolder folder;
    std::vector<DicomSlice> slices;
    for (int k = 0; k < 5; ++k) slices.push_back(slice_at(k, 1));
    change(slices);
    for (std::size_t k = 0; k < slices.size(); ++k) folder.write("s/" + std::to_string(k), dicom_file(slices[k]));
    return error_of(folder.path("s"));
  };
  EXPECT_EQ(error_with([](auto&) {}), "");
  EXPECT_THAT(error_with([](auto& s) { s.erase(s.begin() + 2); }), HasSubstr("missing or unevenly spaced"));
  EXPECT_THAT(error_with([](auto& s) { s[2].position[2] = 2.2; }), HasSubstr("missing or unevenly spaced"));
  EXPECT_THAT(error_with([](auto& s) { s[2].position[2] = 1; }), HasSubstr("same place"));
  EXPECT_THAT(error_with([](auto& s) { s[2].orientation = {0, 1, 0, 1, 0, 0}; }), HasSubstr("orientation"));
  EXPECT_THAT(error_with([](auto& s) { s[2].row_spacing = 2; }), HasSubstr("spacing"));
  EXPECT_THAT(error_with([](auto& s) {
                s[2].columns = 2;
                s[2].rows = 3;
              }),
              HasSubstr("one size"));
}

TEST(Dicom, Truncated) {
  const TemporaryFolder folder;
  const Bytes whole = dicom_file(slice_at(0, 1));
  for (const std::size_t n : {140UL, 200UL, whole.size() - 200, whole.size() - 5})
    EXPECT_NE(error_of(folder.write("cut.dcm", whole.substr(0, n))), "") << n;
}

}  // namespace
}  // namespace treemarch
