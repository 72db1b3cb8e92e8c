#include "treemarch/image/sample_source.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

constexpr std::size_t kChunk = std::size_t{1} << 20;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

[[noreturn]] void fail_short(const std::string& file, std::size_t there, std::size_t wanted) {
  fail(file, "is cut short: " + std::to_string(there) + " of " + std::to_string(wanted) +
                 " bytes of data are there; get a complete copy");
}

/// Opens a file and goes to its samples.
std::ifstream open_at_samples(const std::string& file, const SampleSource& source, std::size_t bytes) {
  std::ifstream in(file, std::ios::binary);
  if (!in) fail(file, "cannot be opened; check its permissions");
  if (source.skip_bytes < 0) {
    const auto size = static_cast<std::size_t>(std::filesystem::file_size(file));
    if (size < bytes) fail_short(file, size, bytes);
    in.seekg(static_cast<std::streamoff>(size - bytes));
    return in;
  }
  std::string line;
  for (std::int64_t n = 0; n < source.skip_lines && std::getline(in, line); ++n) {
  }
  in.seekg(source.skip_bytes, std::ios::cur);
  return in;
}

void read_raw(const std::string& file, std::ifstream& in, std::byte* out, std::size_t bytes,
              const Execution& execution) {
  for (std::size_t at = 0; at < bytes;) {
    execution.check();
    const std::size_t n = std::min(kChunk * 16, bytes - at);
    in.read(reinterpret_cast<char*>(out + at), static_cast<std::streamsize>(n));
    at += static_cast<std::size_t>(in.gcount());
    if (!in) fail_short(file, at, bytes);
  }
}

/// zlib's state, freed with the object.
struct Inflater {
  z_stream z{};
  Inflater() { inflateInit2(&z, 15 + 32); }  // 32: tells zlib and gzip apart by itself
  ~Inflater() { inflateEnd(&z); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

void read_deflated(const std::string& file, std::ifstream& in, std::byte* out, std::size_t bytes,
                   const Execution& execution) {
  Inflater inflater;
  z_stream& z = inflater.z;
  std::vector<char> packed(kChunk);
  std::byte beyond{};  // room for what follows the samples: the stream is read to its end, where its checksum is
  std::size_t at = 0;
  int state = Z_OK;
  while (true) {
    if (z.avail_in == 0) {
      execution.check();
      in.read(packed.data(), static_cast<std::streamsize>(packed.size()));
      z.next_in = reinterpret_cast<Bytef*>(packed.data());
      z.avail_in = static_cast<uInt>(in.gcount());
      if (z.avail_in == 0) fail_short(file, at, bytes);
    }
    if (state == Z_STREAM_END) inflateReset(&z);  // gzip files may be joined
    const std::size_t room = std::min(kChunk * 256, bytes - at);
    z.next_out = reinterpret_cast<Bytef*>(room > 0 ? out + at : &beyond);
    z.avail_out = static_cast<uInt>(room > 0 ? room : 1);
    state = inflate(&z, Z_NO_FLUSH);
    if (room > 0) at += room - z.avail_out;
    if (state == Z_STREAM_END && at == bytes) return;
    if (room == 0 && z.avail_out == 0) return;  // more than the header wants; that is no harm
    if (state != Z_OK && state != Z_STREAM_END && state != Z_BUF_ERROR)
      fail(file, "its compressed data are damaged; get a complete copy");
  }
}

void read_text(const std::string& file, std::ifstream& in, std::byte* out, std::size_t samples, RawImage& image) {
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const char* at = text.data();
  const char* const end = at + text.size();
  image.visit(0, 0, [&]<class T>(std::span<const T>) {
    for (std::size_t i = 0; i < samples; ++i) {
      while (at != end && (std::isspace(static_cast<unsigned char>(*at)) || *at == ',')) ++at;
      T value{};
      const auto [stop, failed] = std::from_chars(at, end, value);
      if (failed != std::errc{})
        fail(file, at == end ? "is cut short: " + std::to_string(i) + " of " + std::to_string(samples) +
                                   " numbers are there; get a complete copy"
                             : "holds '" + std::string(at, std::min(at + 10, end)) +
                                   "' where a number that fits its type should be; repair it");
      std::memcpy(out + i * sizeof(T), &value, sizeof(T));
      at = stop;
    }
  });
}

}  // namespace

void read_samples(const std::string& path, const SampleSource& source, std::span<const std::int64_t> sizes,
                  RawImage& image, const Execution& execution) {
  std::int64_t stored = 0;
  for (const std::string& file : source.files) {
    std::error_code failed;
    stored += static_cast<std::int64_t>(std::filesystem::file_size(file, failed));
    if (failed) fail(path, "its data file " + file + " is missing; put it beside the header");
  }
  const std::size_t sample = sample_bytes(image.type);
  const double ratio = source.encoding == SampleEncoding::raw    ? 1
                       : source.encoding == SampleEncoding::text ? static_cast<double>(sample)
                                                                 : kDeflateRatio;
  check_size(path, sizes, sample, stored, ratio);
  const auto samples = static_cast<std::size_t>(image.voxels() * image.volumes);
  if (source.files.empty() || samples % source.files.size() != 0)
    fail(path, "its " + std::to_string(source.files.size()) +
                   " data files do not share its samples evenly; repair the header");
  image.allocate(path);
  const std::size_t part = samples / source.files.size();
  std::byte* out = image.data.get();
  for (const std::string& file : source.files) {
    std::ifstream in = open_at_samples(file, source, part * sample);
    if (source.encoding == SampleEncoding::raw) read_raw(file, in, out, part * sample, execution);
    if (source.encoding == SampleEncoding::deflate) read_deflated(file, in, out, part * sample, execution);
    if (source.encoding == SampleEncoding::text) read_text(file, in, out, part, image);
    out += part * sample;
  }
  if (source.big_endian && source.encoding != SampleEncoding::text) swap_bytes(image.data.get(), samples, sample);
}

std::string beside(const std::string& header, const std::string& name) {
  return (std::filesystem::path(header).parent_path() / name).string();
}

std::vector<std::string> files_of_pattern(const std::string& header, const std::string& pattern, std::int64_t first,
                                          std::int64_t last, std::int64_t step) {
  const std::size_t percent = pattern.find('%');
  if (percent == std::string::npos) return {beside(header, pattern)};
  std::size_t end = percent + 1;
  const bool zeros = end < pattern.size() && pattern[end] == '0';
  std::size_t width = 0;
  for (; end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9' && width < 100; ++end)
    width = 10 * width + static_cast<std::size_t>(pattern[end] - '0');
  const bool number = end < pattern.size() && (pattern[end] == 'd' || pattern[end] == 'i');
  constexpr std::int64_t kMost = 1'000'000;
  if (!number || width > 20 || pattern.find('%', end) != std::string::npos || step == 0 || std::abs(first) > kMost ||
      std::abs(last) > kMost)
    fail(header, "its pattern of data files '" + pattern + "' is not understood; give one %d and a range");
  std::vector<std::string> files;
  for (std::int64_t n = first; step > 0 ? n <= last : n >= last; n += step) {
    std::string digits = std::to_string(n);
    if (digits.size() < width) digits.insert(0, width - digits.size(), zeros ? '0' : ' ');
    files.push_back(beside(header, pattern.substr(0, percent) + digits + pattern.substr(end + 1)));
  }
  return files;
}

}  // namespace treemarch
