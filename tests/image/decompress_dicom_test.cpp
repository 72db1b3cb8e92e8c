#include "treemarch/image/decompress_dicom.h"

#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmImageWriter.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;
using ::testing::HasSubstr;
using Syntax = gdcm::TransferSyntax::TSType;

constexpr Syntax kSyntaxes[] = {gdcm::TransferSyntax::RLELossless, gdcm::TransferSyntax::JPEGLosslessProcess14_1,
                                gdcm::TransferSyntax::JPEGLSLossless, gdcm::TransferSyntax::JPEG2000Lossless};

DicomSlice labelled_slice(unsigned stored, bool is_signed) {
  DicomSlice s;
  s.columns = 24;
  s.rows = 16;
  s.stored = stored;
  s.is_signed = is_signed;
  const unsigned limit = 1U << stored;
  for (unsigned y = 0; y < s.rows; ++y)
    for (unsigned x = 0; x < s.columns; ++x) {
      unsigned value = (x / 5 + 7 * (y / 4)) * (limit / 128);  // blocks, up to a quarter of what fits
      if (is_signed && x / 5 % 2) value = limit - 1 - value;
      s.values.push_back(static_cast<std::uint16_t>(value));
    }
  return s;
}

/// Writes a file anew with compressed pixels.
std::string compress(const TemporaryFolder& folder, const std::string& plain, Syntax syntax) {
  gdcm::ImageReader reader;
  reader.SetFileName(plain.c_str());
  EXPECT_TRUE(reader.Read());
  gdcm::ImageChangeTransferSyntax change;
  change.SetTransferSyntax(syntax);
  change.SetInput(reader.GetImage());
  EXPECT_TRUE(change.Change());
  const std::string path = folder.path("packed.dcm");
  gdcm::ImageWriter writer;
  writer.SetFile(reader.GetFile());
  writer.SetImage(change.GetOutput());
  writer.SetFileName(path.c_str());
  EXPECT_TRUE(writer.Write());
  return path;
}

TEST(DecompressDicom, LabelsAreThoseOfThePlainFile) {
  const TemporaryFolder folder;
  for (const Syntax syntax : kSyntaxes)
    for (const unsigned stored : {12U, 16U})
      for (const bool is_signed : {false, true}) {
        const std::string plain = folder.write("plain.dcm", dicom_file(labelled_slice(stored, is_signed)));
        const std::string packed = compress(folder, plain, syntax);
        EXPECT_EQ(labels_of(read<3>(packed)), labels_of(read<3>(plain)))
            << gdcm::TransferSyntax::GetTSString(syntax) << ", " << stored << " bits" << (is_signed ? ", signed" : "");
      }
}

Bytes contents(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(DecompressDicom, TruncatedFilesAreErrors) {
  const TemporaryFolder folder;
  for (const Syntax syntax : kSyntaxes) {
    const Bytes whole =
        contents(compress(folder, folder.write("plain.dcm", dicom_file(labelled_slice(16, false))), syntax));
    for (std::size_t cut = 30; cut < 200 && cut < whole.size() - 132; cut += 17)
      EXPECT_THAT(error_of(folder.write("cut.dcm", whole.substr(0, whole.size() - cut))), HasSubstr("complete copy"))
          << gdcm::TransferSyntax::GetTSString(syntax) << " without " << cut << " bytes";
  }
}

/// Pixels may be wrong then, or the file is refused; nothing else may happen.
TEST(DecompressDicom, DamagedPixelsEndNothing) {
  const TemporaryFolder folder;
  std::mt19937 random(7);
  int refused = 0;
  for (const Syntax syntax : kSyntaxes) {
    const Bytes whole =
        contents(compress(folder, folder.write("plain.dcm", dicom_file(labelled_slice(16, false))), syntax));
    const std::size_t pixels = whole.rfind("\xe0\x7f\x10") + 12;
    for (int trial = 0; trial < 20; ++trial) {
      Bytes damaged = whole;
      for (int i = 0; i < 5; ++i)
        damaged[pixels + random() % (whole.size() - pixels)] = static_cast<char>(random() & 0xff);
      refused += error_of(folder.write("damaged.dcm", damaged)).empty() ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 0);
}

TEST(DecompressDicom, NumberOfPixelsIsThatOfTheHeader) {
  const TemporaryFolder folder;
  const std::string packed = compress(folder, folder.write("plain.dcm", dicom_file(labelled_slice(16, false))),
                                      gdcm::TransferSyntax::RLELossless);
  EXPECT_EQ(decompress_dicom(packed, 24 * 16).format.bits, 16U);
  for (const std::int64_t pixels : {24 * 15, 24 * 17, 24 * 160})
    EXPECT_THROW(decompress_dicom(packed, pixels), Error) << pixels;
}

}  // namespace
}  // namespace treemarch
