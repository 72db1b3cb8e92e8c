/// \file
/// What the file readers hand over: samples as the file stores them and its geometry, nothing interpreted yet.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace treemarch {

enum class SampleType : std::uint8_t { u8, i8, u16, i16, u32, i32, u64, i64, f32, f64 };

/// Bytes of one sample.
[[nodiscard]] std::size_t sample_bytes(SampleType type);

/// Calls f with a value of a sample's type.
template <class F>
decltype(auto) visit_type(SampleType type, F&& f) {
  switch (type) {
    case SampleType::u8:
      return f(std::uint8_t{});
    case SampleType::i8:
      return f(std::int8_t{});
    case SampleType::u16:
      return f(std::uint16_t{});
    case SampleType::i16:
      return f(std::int16_t{});
    case SampleType::u32:
      return f(std::uint32_t{});
    case SampleType::i32:
      return f(std::int32_t{});
    case SampleType::u64:
      return f(std::uint64_t{});
    case SampleType::i64:
      return f(std::int64_t{});
    case SampleType::f32:
      return f(float{});
    default:
      return f(double{});
  }
}

/// The samples of a file, from the first to the last, as they are asked for: an image is never in memory at the width
/// of its file.
class SampleStream {
 public:
  SampleStream() = default;
  virtual ~SampleStream() = default;
  SampleStream(const SampleStream&) = delete;
  SampleStream& operator=(const SampleStream&) = delete;
  /// Writes the next samples, in this machine's byte order. \pre no more than are left are asked for, and whole ones
  /// \throw Error(input) where the file is cut short or damaged; a checksum is looked at with the last sample
  virtual void read(std::byte* to, std::size_t bytes) = 0;
};

/// Samples of formats that are not read piece by piece.
class MemorySamples : public SampleStream {
 public:
  explicit MemorySamples(std::size_t bytes) : bytes_(std::make_unique_for_overwrite<std::byte[]>(bytes)) {}
  [[nodiscard]] std::byte* data() { return bytes_.get(); }
  void read(std::byte* to, std::size_t bytes) override {
    std::copy_n(bytes_.get() + at_, bytes, to);
    at_ += bytes;
  }

 private:
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t at_ = 0;
};

/// An image file.
struct RawImage {
  int dim = 3;  ///< axes of space, 2 or 3
  std::array<std::int64_t, 3> extent{1, 1, 1};
  std::int64_t volumes = 1;   ///< images one after the other in `samples` (time, layers)
  double volume_spacing = 1;  ///< step from one volume to the next (seconds), where the file knows it
  SampleType type = SampleType::u8;
  double slope = 1, intercept = 0;        ///< value = slope * sample + intercept
  std::unique_ptr<SampleStream> samples;  ///< first axis fastest, volumes slowest

  /// World position of the centre of voxel i: origin + sum of axis[a] * i[a], in millimetres where the unit is known.
  std::array<std::array<double, 3>, 3> axis{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  std::array<double, 3> origin{};
  std::string space;                                        ///< as Frame::space, one letter an axis of space
  bool has_spacing = true;                                  ///< false where the file carries none
  std::vector<std::pair<std::int32_t, std::string>> names;  ///< names of labels, where the file has them

  [[nodiscard]] std::int64_t voxels() const { return extent[0] * extent[1] * extent[2]; }
  /// Of all samples.
  [[nodiscard]] std::size_t bytes() const { return static_cast<std::size_t>(voxels() * volumes) * sample_bytes(type); }
  /// Makes room for all samples, which become those of the image. \return where they are to be written
  std::byte* allocate();
  /// Reads all samples into memory, so that the file may be closed.
  void load();
};

/// Reverses the bytes of each sample.
void swap_bytes(std::byte* data, std::size_t samples, std::size_t bytes_per_sample);

/// Checks what a header claims before anything is allocated for it.
/// \param extent the sizes of the image's axes (up to 3), then of those beyond
/// \param stored_bytes size of the file that holds the samples, or negative where it is not known
/// \param compression largest ratio by which the encoding can shrink samples, 1 for none
/// \throw Error(input) for sizes below 1, beyond 32 bit or larger than the file can hold.
void check_size(const std::string& path, std::span<const std::int64_t> extent, std::size_t bytes_per_sample,
                std::int64_t stored_bytes, double compression);

/// The largest ratio that deflate (gzip, PNG, zlib) can reach, with a margin.
inline constexpr double kDeflateRatio = 1100;

/// Joins equal slices (dim 2, or 3 with one slice) along a new third axis; mixed sample types become double. Geometry
/// is that of the first slice with `axis[2]` left as it is. A slice is let go as soon as it has been read. \param paths
/// names of the slices, for messages. \throw Error(input) where a slice has another size than the first.
RawImage stack_slices(std::vector<RawImage> slices, const std::vector<std::string>& paths);

}  // namespace treemarch
