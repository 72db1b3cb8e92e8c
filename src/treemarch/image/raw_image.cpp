#include "treemarch/image/raw_image.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "treemarch/core/error.h"

namespace treemarch {

std::size_t sample_bytes(SampleType type) {
  switch (type) {
    case SampleType::u8:
    case SampleType::i8:
      return 1;
    case SampleType::u16:
    case SampleType::i16:
      return 2;
    case SampleType::u32:
    case SampleType::i32:
    case SampleType::f32:
      return 4;
    default:
      return 8;
  }
}

std::byte* RawImage::allocate() {
  auto memory = std::make_unique<MemorySamples>(bytes());
  std::byte* const data = memory->data();
  samples = std::move(memory);
  return data;
}

void RawImage::load() {
  const std::unique_ptr<SampleStream> stream = std::move(samples);
  stream->read(allocate(), bytes());
}

void swap_bytes(std::byte* data, std::size_t samples, std::size_t bytes_per_sample) {
  if (bytes_per_sample == 1) return;
  for (std::size_t i = 0; i < samples; ++i, data += bytes_per_sample) std::reverse(data, data + bytes_per_sample);
}

void check_size(const std::string& path, std::span<const std::int64_t> extent, std::size_t bytes_per_sample,
                std::int64_t stored_bytes, double compression) {
  std::string sizes;
  for (const std::int64_t n : extent) sizes += (sizes.empty() ? "" : " x ") + std::to_string(n);
  double total = static_cast<double>(bytes_per_sample);
  for (const std::int64_t n : extent) {
    if (n < 1 || n > std::numeric_limits<std::int32_t>::max())
      throw Error(ErrorKind::input,
                  path + ": its header claims a size of " + sizes + ", which cannot be; the file is damaged");
    total *= static_cast<double>(n);
  }
  // 2^53: beyond it the product is no longer exact, and no machine holds it.
  if (total > 9e15)
    throw Error(ErrorKind::input,
                path + ": its header claims a size of " + sizes + ", which cannot be; the file is damaged");
  if (stored_bytes >= 0 && total > compression * static_cast<double>(stored_bytes))
    throw Error(ErrorKind::input, path + ": its header claims " + sizes + " samples of " +
                                      std::to_string(bytes_per_sample) + " bytes, but the data are only " +
                                      std::to_string(stored_bytes) +
                                      " bytes; the file is cut short or its header is wrong");
}

namespace {

/// One slice after the other, each of which is let go as soon as it has been read.
class StackSamples : public SampleStream {
 public:
  explicit StackSamples(std::vector<RawImage> slices) : slices_(std::move(slices)) {}
  void read(std::byte* to, std::size_t bytes) override {
    while (bytes > 0) {
      RawImage& slice = slices_[next_];
      const std::size_t n = std::min(bytes, slice.bytes() - done_);
      slice.samples->read(to, n);
      to += n;
      bytes -= n;
      done_ += n;
      if (done_ < slice.bytes()) continue;
      slice.samples.reset();
      ++next_;
      done_ = 0;
    }
  }

 private:
  std::vector<RawImage> slices_;
  std::size_t next_ = 0, done_ = 0;  // bytes of the next
};

void make_double(RawImage& slice) {
  slice.load();
  const std::unique_ptr<SampleStream> stream = std::move(slice.samples);
  visit_type(slice.type, [&]<class T>(T sample) {
    slice.type = SampleType::f64;
    std::byte* out = slice.allocate();
    for (std::int64_t i = 0; i < slice.voxels(); ++i, out += sizeof(double)) {
      stream->read(reinterpret_cast<std::byte*>(&sample), sizeof(T));
      const double v = slice.slope * static_cast<double>(sample) + slice.intercept;
      std::memcpy(out, &v, sizeof v);
    }
  });
  slice.slope = 1;
  slice.intercept = 0;
}

}  // namespace

RawImage stack_slices(std::vector<RawImage> slices, const std::vector<std::string>& paths) {
  const RawImage& first = slices.front();
  bool as_double = false;
  for (std::size_t s = 0; s < slices.size(); ++s) {
    const RawImage& slice = slices[s];
    if (slice.extent != first.extent)
      throw Error(ErrorKind::input, paths[s] + ": has " + std::to_string(slice.extent[0]) + " x " +
                                        std::to_string(slice.extent[1]) + " pixels, but " + paths[0] + " has " +
                                        std::to_string(first.extent[0]) + " x " + std::to_string(first.extent[1]) +
                                        "; all slices of a stack must have one size");
    as_double |= slice.type != first.type || slice.slope != first.slope || slice.intercept != first.intercept;
  }
  if (as_double)
    for (RawImage& slice : slices) make_double(slice);
  RawImage stack;
  stack.dim = 3;
  stack.extent = {first.extent[0], first.extent[1], static_cast<std::int64_t>(slices.size())};
  stack.type = first.type;
  stack.slope = first.slope;
  stack.intercept = first.intercept;
  stack.axis = first.axis;
  stack.origin = first.origin;
  stack.space = first.space;
  stack.has_spacing = first.has_spacing;
  stack.samples = std::make_unique<StackSamples>(std::move(slices));
  return stack;
}

}  // namespace treemarch
