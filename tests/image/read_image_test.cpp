#include "treemarch/image/read_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <sstream>

#include "image/image_files.h"
#include "treemarch/core/error.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;

TEST(ReadImage, RealImage) {
  const auto image = read<3>(TREEMARCH_DATA "/abdomen_ct_61organs.nii.gz");
  EXPECT_EQ(image.extent, (Coord<3>{122, 101, 112}));
  EXPECT_EQ(image.labels.size(), 62U);
  EXPECT_EQ(image.frame.space, "RAS");
  std::vector<std::int64_t> count(image.labels.size());
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) ++count[image.voxels[i]];
  EXPECT_EQ(count[0], 1034076);
  const Vec<3> origin{-177.956329, 11.3190002, 94.3017578};
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(image.frame.spacing[d], 3, 1e-6);
    EXPECT_NEAR(image.frame.origin[d], origin[d], 1e-5);
  }
}

TEST(ReadImage, ContentCountsMoreThanTheName) {
  const TemporaryFolder folder;
  EXPECT_EQ(read<2>(folder.write("a.nii", png_file(2, 1, 8, 0, {"ab"}))).extent, (Coord<2>{2, 1}));
  EXPECT_EQ(read<2>(folder.write("noext", png_file(2, 1, 8, 0, {"ab"}))).extent, (Coord<2>{2, 1}));
  EXPECT_EQ(read<3>(folder.write("a.dcm", NiftiFile{}.header() + Bytes(24, '\1'))).extent, (Coord<3>{2, 3, 4}));
}

TEST(ReadImage, StackOfSlicesInNaturalOrder) {
  const TemporaryFolder folder;
  for (const int k : {2, 10, 1}) {
    const char label = static_cast<char>(k);
    folder.write("s/slice" + std::to_string(k) + ".png", png_file(2, 1, 8, 0, {Bytes(2, label)}));
  }
  folder.write("s/readme.txt", "hello");
  folder.write("s/.hidden.png", "hidden");
  const auto image = read<3>(folder.path("s"), {.spacing = {1, 1, 4}});
  EXPECT_EQ(labels_of(image), (std::vector<std::int64_t>{1, 1, 2, 2, 10, 10}));
  EXPECT_EQ(image.frame.spacing, (Vec<3>{1, 1, 4}));
  folder.write("s/slice3.png", png_file(1, 1, 8, 0, {"a"}));
  EXPECT_THAT(error_of(folder.path("s")), HasSubstr("one size"));
  folder.write("t/a.txt", "hello");
  EXPECT_THAT(error_of(folder.path("t")), HasSubstr("without images"));
}

TEST(ReadImage, GreyValues) {
  const TemporaryFolder folder;
  NiftiFile file;
  file.slope = 0.5;
  file.intercept = -1;
  file.sform_code = 1;
  file.srow = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  Bytes values;
  for (char i = 0; i < 24; ++i) values += i;
  const Execution execution(2);
  const auto grey =
      std::get<GreyImage<3>>(read_grey_image(folder.write("a.nii", file.header() + values), {}, execution));
  ASSERT_EQ(grey.values.size(), 24U);
  for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(grey.values[i], 0.5F * static_cast<float>(i) - 1);
}

TEST(ReadImage, BadFiles) {
  const TemporaryFolder folder;
  EXPECT_THAT(error_of(folder.path("absent.nii")), HasSubstr("does not exist"));
  for (const char* name : {"empty.nii", "empty.nrrd", "empty.mha", "empty.tif", "empty.png", "empty.dcm", "empty"})
    EXPECT_THAT(error_of(folder.write(name, "")), HasSubstr("is empty"));
  for (const char* name :
       {"text.nii", "text.nii.gz", "text.nrrd", "text.mha", "text.mhd", "text.tif", "text.png", "text.dcm", "text.txt"})
    EXPECT_NE(error_of(folder.write(name, "This is no image, whatever its name says.\n")), "") << name;
  EXPECT_THAT(error_of(folder.write("data.raw", "samples")), HasSubstr("header file"));
  const std::string own = folder.write("a.nii", NiftiFile{}.header() + Bytes(24, '\1'));
  EXPECT_THAT(error_of(own, {.spacing = {1, 1, 1}}, ErrorKind::usage), HasSubstr("--spacing"));
}

TEST(ReadImage, CancellationIsNoError) {
  const TemporaryFolder folder;
  Execution execution(1);
  execution.cancel();
  const std::string path = folder.write("a.nii", NiftiFile{}.header() + Bytes(24, '\1'));
  EXPECT_THROW(read_label_image(path, {}, execution), Cancelled);
}

/// One valid file of each format.
std::vector<std::pair<std::string, Bytes>> seeds() {
  const TemporaryFolder folder;
  NiftiFile one, two;
  one.sform_code = one.qform_code = 1;
  one.srow = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  two = one;
  two.version = 2;
  two.big_endian = true;
  const Bytes data(24, '\3');
  TiffOptions tiff;
  tiff.compression = 5;
  tiff.tile = 16;
  write_tiff(folder.path("a.tif"), 20, 17, {Bytes(340, '\1'), Bytes(340, '\2')}, tiff);
  std::ostringstream written;
  written << std::ifstream(folder.path("a.tif"), std::ios::binary).rdbuf();
  DicomSlice slice;
  slice.values.assign(6, 2);
  const std::string nrrd =
      "NRRD0004\ntype: uchar\ndimension: 3\nspace: LPS\nsizes: 2 3 4\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
      "kinds: domain domain domain\nendian: little\nspace origin: (0,0,0)\n";
  return {{"a.nii", one.header() + data},
          {"b.nii", two.header() + data},
          {"a.nii.gz", gzip(one.header() + data)},
          {"a.nrrd", nrrd + "encoding: raw\n\n" + data},
          {"b.nrrd", nrrd + "encoding: gzip\n\n" + gzip(data)},
          {"c.nrrd", nrrd + "encoding: ascii\n\n1 2 3 4 5 6 7 8 9 10 11 12 1 2 3 4 5 6 7 8 9 10 11 12\n"},
          {"a.mha",
           "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
           "False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nElementSpacing = 1 1 1\nDimSize = 2 3 "
           "4\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" +
               data},
          {"a.tif", written.str()},
          {"a.png", png_file(4, 2, 8, 0, {"abcd", "efgh"})},
          {"a.dcm", dicom_file(slice)}};
}

/// Changes some bytes, or cuts or repeats a part.
Bytes mutated(Bytes b, std::mt19937& random) {
  const auto at = [&] { return random() % b.size(); };
  switch (random() % 8) {
    case 0:
      return b.substr(0, at());
    case 1: {
      const std::size_t from = at();
      return b.insert(at(), b.substr(from, random() % 20));
    }
    case 2:
      return b.erase(at(), random() % 20);
    default:
      break;
  }
  // The ends of the range and digits reach further than other bytes do.
  constexpr std::array<char, 8> kBytes{'\0', '\1', '\x7f', '\x80', '\xff', '9', '-', ' '};
  for (unsigned n = 1 + random() % 4; n > 0; --n)
    b[at()] = random() % 2 ? kBytes[random() % kBytes.size()] : static_cast<char>(random());
  return b;
}

TEST(ReadImageFuzz, DamagedFilesAreReadOrRefused) {
  const TemporaryFolder folder;
  std::mt19937 random(20240601);
  const Execution execution(1);
  for (const auto& [name, content] : seeds()) {
    int refused = 0;
    EXPECT_NO_THROW(read_label_image(folder.write(name, content), {}, execution)) << name;
    for (int round = 0; round < 300; ++round) {
      const std::string path = folder.write(name, mutated(content, random));
      try {
        read_label_image(path, {}, execution);
      } catch (const Error& e) {
        ++refused;
        EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      }
    }
    EXPECT_GT(refused, 0) << name;
  }
}

}  // namespace
}  // namespace treemarch
