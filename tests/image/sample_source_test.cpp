#include "treemarch/image/sample_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "image/image_files.h"

namespace treemarch {
namespace {

using namespace treemarch::testing;

/// The samples of a 2 x 2 x 2 image of 16 bits, however many are asked for at a time.
std::vector<std::uint16_t> samples_of(const SampleSource& source) {
  std::vector<std::uint16_t> first;
  for (const std::size_t at_a_time : {8U, 4U, 3U, 1U}) {
    RawImage image;
    image.extent = {2, 2, 2};
    image.type = SampleType::u16;
    open_samples("header", source, image.extent, image);
    std::vector<std::uint16_t> samples(8);
    for (std::size_t i = 0; i < 8; i += at_a_time)
      image.samples->read(reinterpret_cast<std::byte*>(&samples[i]), 2 * std::min(at_a_time, 8 - i));
    if (first.empty()) first = samples;
    EXPECT_EQ(samples, first) << at_a_time;
  }
  return first;
}

const std::vector<std::uint16_t> kValues{1, 2, 3, 4, 5, 6, 7, 65535};

TEST(SampleSource, SkipsLinesAndBytes) {
  const TemporaryFolder folder;
  const std::string file = folder.write("a", "line one\nline two\nxyz" + bytes_of_all(kValues));
  EXPECT_EQ(samples_of({.files = {file}, .skip_lines = 2, .skip_bytes = 3}), kValues);
  EXPECT_EQ(samples_of({.files = {file}, .skip_bytes = -1}), kValues);
  EXPECT_THROW(samples_of({.files = {file}, .skip_lines = 2, .skip_bytes = 4}), Error);
  EXPECT_THROW(samples_of({.files = {file}, .skip_bytes = 1000}), Error);
}

TEST(SampleSource, SeveralFilesShareTheSamples) {
  const TemporaryFolder folder;
  const Bytes data = bytes_of_all(kValues, true);
  const std::string a = folder.write("a", gzip(data.substr(0, 8))), b = folder.write("b", gzip(data.substr(8)));
  EXPECT_EQ(samples_of({.files = {a, b}, .encoding = SampleEncoding::deflate, .big_endian = true}), kValues);
  EXPECT_THROW(samples_of({.files = {a, b, a}, .encoding = SampleEncoding::deflate}), Error);
  EXPECT_THROW(samples_of({.files = {a, folder.path("gone")}, .encoding = SampleEncoding::deflate}), Error);
}

TEST(SampleSource, JoinedAndDamagedStreams) {
  const TemporaryFolder folder;
  const Bytes data = bytes_of_all(kValues), joined = gzip(data.substr(0, 5)) + gzip(data.substr(5));
  const auto read_deflated = [&](const Bytes& content) {
    return samples_of({.files = {folder.write("a", content)}, .encoding = SampleEncoding::deflate});
  };
  EXPECT_EQ(read_deflated(joined), kValues);
  for (std::size_t n = 0; n < joined.size(); ++n) EXPECT_THROW(read_deflated(joined.substr(0, n)), Error) << n;
  Bytes wrong = gzip(data);
  wrong[wrong.size() - 6] ^= 1;  // its checksum
  EXPECT_THROW(read_deflated(wrong), Error);
}

TEST(SampleSource, Text) {
  const TemporaryFolder folder;
  const auto read_text = [&](const Bytes& content) {
    return samples_of({.files = {folder.write("a", content)}, .encoding = SampleEncoding::text});
  };
  EXPECT_EQ(read_text("1 2\n3,4\t5 6 7 65535"), kValues);
  EXPECT_EQ(read_text(Bytes(3 << 20, ' ') + "1 2 3 4" + Bytes(1 << 20, '\n') + "5 6 7 65535\n"), kValues);
  EXPECT_THROW(read_text("1 2 3 4 5 6 7"), Error);
  EXPECT_THROW(read_text("1 2 3 4 5 6 7 65536"), Error);
}

TEST(FilesOfPattern, Expands) {
  const auto files = [](const std::string& pattern, std::int64_t first, std::int64_t last, std::int64_t step) {
    return files_of_pattern("folder/header", pattern, first, last, step);
  };
  EXPECT_EQ(files("a%03d.raw", 9, 11, 1),
            (std::vector<std::string>{"folder/a009.raw", "folder/a010.raw", "folder/a011.raw"}));
  EXPECT_EQ(files("%d", 3, 1, -2), (std::vector<std::string>{"folder/3", "folder/1"}));
  EXPECT_EQ(files("plain", 0, 0, 1), (std::vector<std::string>{"folder/plain"}));
  for (const char* bad : {"%s", "%n%d", "%", "%99999d"}) EXPECT_THROW(files(bad, 1, 2, 1), Error) << bad;
  EXPECT_THROW(files("%d", 1, 2, 0), Error);
}

}  // namespace
}  // namespace treemarch
