#include "treemarch/image/dicom_elements.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;

Bytes tag(unsigned group, unsigned element, bool big_endian = false) {
  return bytes_of(static_cast<std::uint16_t>(group), big_endian) +
         bytes_of(static_cast<std::uint16_t>(element), big_endian);
}

Bytes start(const std::string& syntax) {
  return Bytes(128, '\0') + "DICM" + tag(2, 0x10) + "UI" + bytes_of(static_cast<std::uint16_t>(syntax.size())) + syntax;
}

const Bytes kUndefined(4, '\xff');

TEST(DicomElements, ImplicitSyntaxWithNestedSequencesOfUndefinedLength) {
  const Bytes item = tag(0xfffe, 0xe000), item_end = tag(0xfffe, 0xe00d), end = tag(0xfffe, 0xe0dd);
  const Bytes inner = tag(8, 0x16) + bytes_of(std::uint32_t{2}) + "xy";
  const Bytes nested = tag(8, 0x1140) + kUndefined + item + kUndefined + inner + item_end + Bytes(4, '\0') + item +
                       bytes_of(static_cast<std::uint32_t>(inner.size())) + inner + end + Bytes(4, '\0');
  const Bytes outer =
      tag(8, 0x1115) + kUndefined + item + kUndefined + nested + item_end + Bytes(4, '\0') + end + Bytes(4, '\0');
  const Bytes whole = start("1.2.840.10008.1.2" + std::string(1, '\0')) + outer + tag(0x28, 0x10) +
                      bytes_of(std::uint32_t{2}) + bytes_of(std::uint16_t{513}) + tag(0x28, 0x30) +
                      bytes_of(std::uint32_t{8}) + " 0.5\\+3 " + tag(0x7fe0, 0x10) + bytes_of(std::uint32_t{2}) + "ab";
  const TemporaryFolder folder;
  const DicomElements dicom = read_dicom_elements(folder.write("a", whole));
  EXPECT_EQ(dicom.find(0x00080016), nullptr) << "inside a sequence";
  EXPECT_EQ(dicom.number(0x00280010), 513U);
  EXPECT_EQ(dicom.decimals(0x00280030), (std::vector<double>{0.5, 3}));
  EXPECT_EQ(dicom.text(0x7fe00010), "ab");
  EXPECT_FALSE(dicom.compressed);
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_THROW(read_dicom_elements(folder.write("a", whole.substr(0, n))), Error) << n;
}

TEST(DicomElements, BigEndianAndEncapsulated) {
  const TemporaryFolder folder;
  const Bytes big = start("1.2.840.10008.1.2.2" + std::string(1, '\0')) + tag(0x28, 0x10, true) + "US" +
                    bytes_of(std::uint16_t{2}, true) + bytes_of(std::uint16_t{513}, true) + tag(0x7fe0, 0x10, true) +
                    "OW" + Bytes(2, '\0') + bytes_of(std::uint32_t{2}, true) + "ab";
  EXPECT_EQ(read_dicom_elements(folder.write("a", big)).number(0x00280010), 513U);
  const Bytes packed = start("1.2.840.10008.1.2.4.70") + tag(0x7fe0, 0x10) + "OB" + Bytes(2, '\0') + kUndefined +
                       tag(0xfffe, 0xe000) + Bytes(4, '\0') + tag(0xfffe, 0xe000) + bytes_of(std::uint32_t{2}) + "ab" +
                       tag(0xfffe, 0xe0dd) + Bytes(4, '\0');
  EXPECT_TRUE(read_dicom_elements(folder.write("b", packed)).compressed);
}

TEST(DicomElements, UnknownSyntaxIsAnError) {
  const TemporaryFolder folder;
  EXPECT_THROW(read_dicom_elements(folder.write("a", start("1.2.840.10008.1.2.1.99") + tag(8, 0) + "xxxx")), Error);
}

}  // namespace
}  // namespace treemarch
