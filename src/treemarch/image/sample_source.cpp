#include "treemarch/image/sample_source.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <utility>

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

/// zlib's state, freed with the object.
struct Inflater {
  z_stream z{};
  Inflater() { inflateInit2(&z, 15 + 32); }  // 32: tells zlib and gzip apart by itself
  ~Inflater() { inflateEnd(&z); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

/// The samples of one file.
class FilePart {
 public:
  /// \param bytes of its samples in memory
  FilePart(std::string file, const SampleSource& source, std::size_t bytes, SampleType type)
      : file_(std::move(file)), in_(file_, std::ios::binary), encoding_(source.encoding), type_(type), bytes_(bytes) {
    if (!in_) fail(file_, "cannot be opened; check its permissions");
    if (source.skip_bytes < 0) {
      const auto size = static_cast<std::size_t>(std::filesystem::file_size(file_));
      if (size < bytes) fail_short(file_, size, bytes);
      in_.seekg(static_cast<std::streamoff>(size - bytes));
      return;
    }
    std::string line;
    for (std::int64_t n = 0; n < source.skip_lines && std::getline(in_, line); ++n) {
    }
    in_.seekg(source.skip_bytes, std::ios::cur);
  }

  [[nodiscard]] std::size_t left() const { return bytes_ - at_; }
  void read(std::byte* to, std::size_t bytes) {
    if (encoding_ == SampleEncoding::raw) read_raw(to, bytes);
    if (encoding_ == SampleEncoding::deflate) read_deflated(to, bytes);
    if (encoding_ == SampleEncoding::text) read_text(to, bytes);
  }

 private:
  void read_raw(std::byte* to, std::size_t bytes) {
    in_.read(reinterpret_cast<char*>(to), static_cast<std::streamsize>(bytes));
    at_ += static_cast<std::size_t>(in_.gcount());
    if (!in_) fail_short(file_, at_, bytes_);
  }
  void read_deflated(std::byte* to, std::size_t bytes);
  void read_text(std::byte* to, std::size_t bytes);
  void refill();

  std::string file_;
  std::ifstream in_;
  SampleEncoding encoding_;
  SampleType type_;
  std::size_t bytes_, at_ = 0;
  Inflater inflater_;
  int state_ = Z_OK;
  std::string buffer_;        // as the file has it
  std::size_t consumed_ = 0;  // of a text in the buffer
};

void FilePart::read_deflated(std::byte* to, std::size_t bytes) {
  z_stream& z = inflater_.z;
  const std::size_t end = at_ + bytes;
  std::byte beyond{};  // room for what follows the samples: the stream is read to its end, where its checksum is
  while (at_ < end || end == bytes_) {
    if (z.avail_in == 0) {
      buffer_.resize(kChunk);
      in_.read(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
      z.next_in = reinterpret_cast<Bytef*>(buffer_.data());
      z.avail_in = static_cast<uInt>(in_.gcount());
      if (z.avail_in == 0) fail_short(file_, at_, bytes_);
    }
    if (state_ == Z_STREAM_END) inflateReset(&z);  // gzip files may be joined
    const std::size_t room = std::min(kChunk * 256, end - at_);
    z.next_out = reinterpret_cast<Bytef*>(room > 0 ? to : &beyond);
    z.avail_out = static_cast<uInt>(room > 0 ? room : 1);
    state_ = inflate(&z, Z_NO_FLUSH);
    if (room > 0) {
      at_ += room - z.avail_out;
      to += room - z.avail_out;
    }
    if (state_ == Z_STREAM_END && at_ == bytes_) return;
    if (room == 0 && z.avail_out == 0) return;  // more than the header wants; that is no harm
    if (state_ != Z_OK && state_ != Z_STREAM_END && state_ != Z_BUF_ERROR)
      fail(file_, "its compressed data are damaged; get a complete copy");
  }
}

/// Whole words of a text: the rest of the buffer, and more of the file.
void FilePart::refill() {
  buffer_.erase(0, consumed_);
  consumed_ = 0;
  const std::size_t there = buffer_.size();
  buffer_.resize(there + kChunk);
  in_.read(buffer_.data() + there, kChunk);
  buffer_.resize(there + static_cast<std::size_t>(in_.gcount()));
}

void FilePart::read_text(std::byte* to, std::size_t bytes) {
  constexpr std::size_t kLongest = 400;  // characters of a number
  visit_type(type_, [&]<class T>(T value) {
    const auto separates = [](char c) { return std::isspace(static_cast<unsigned char>(c)) || c == ','; };
    for (const std::size_t end = at_ + bytes; at_ < end; at_ += sizeof(T), to += sizeof(T)) {
      do {
        if (in_ && buffer_.size() - consumed_ < kLongest) refill();
        while (consumed_ < buffer_.size() && separates(buffer_[consumed_])) ++consumed_;
      } while (in_ && buffer_.size() - consumed_ < kLongest);
      const char* const begin = buffer_.data() + consumed_;
      const char* const stop = buffer_.data() + buffer_.size();
      const auto [after, failed] = std::from_chars(begin, stop, value);
      if (failed != std::errc{})
        fail(file_, begin == stop ? "is cut short: " + std::to_string(at_ / sizeof(T)) + " of " +
                                        std::to_string(bytes_ / sizeof(T)) + " numbers are there; get a complete copy"
                                  : "holds '" + std::string(begin, std::min(begin + 10, stop)) +
                                        "' where a number that fits its type should be; repair it");
      std::memcpy(to, &value, sizeof(T));
      consumed_ += static_cast<std::size_t>(after - begin);
    }
  });
}

/// The files one after the other.
class FileSamples : public SampleStream {
 public:
  FileSamples(SampleSource source, std::size_t bytes, SampleType type)
      : source_(std::move(source)), bytes_(bytes / source_.files.size()), type_(type) {}
  void read(std::byte* to, std::size_t bytes) override {
    std::byte* const begin = to;
    const std::size_t all = bytes;
    while (bytes > 0) {
      if (!part_) part_ = std::make_unique<FilePart>(source_.files[next_++], source_, bytes_, type_);
      const std::size_t n = std::min(bytes, part_->left());
      part_->read(to, n);
      to += n;
      bytes -= n;
      if (part_->left() == 0) part_.reset();
    }
    const std::size_t sample = sample_bytes(type_);
    if (source_.big_endian && source_.encoding != SampleEncoding::text) swap_bytes(begin, all / sample, sample);
  }

 private:
  SampleSource source_;
  std::size_t bytes_;  // of a file
  SampleType type_;
  std::size_t next_ = 0;
  std::unique_ptr<FilePart> part_;
};

}  // namespace

void open_samples(const std::string& path, const SampleSource& source, std::span<const std::int64_t> sizes,
                  RawImage& image) {
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
  image.samples = std::make_unique<FileSamples>(source, image.bytes(), image.type);
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
