#include "treemarch/image/raw_image.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <new>

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

void RawImage::allocate(const std::string& path) {
  try {
    data =
        std::make_unique_for_overwrite<std::byte[]>(static_cast<std::size_t>(voxels() * volumes) * sample_bytes(type));
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::limits, path + ": too large for the memory of this machine; crop or downsample it");
  }
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

void append_slice(const RawImage& slice, bool as_double, std::byte* out) {
  if (!as_double) {
    std::memcpy(out, slice.data.get(), static_cast<std::size_t>(slice.voxels()) * sample_bytes(slice.type));
    return;
  }
  slice.visit(0, 1, [&](auto samples) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double v = slice.slope * static_cast<double>(samples[i]) + slice.intercept;
      std::memcpy(out + i * sizeof v, &v, sizeof v);
    }
  });
}

}  // namespace

RawImage stack_slices(std::vector<RawImage> slices, const std::vector<std::string>& paths) {
  RawImage& first = slices.front();
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
  RawImage stack;
  stack.dim = 3;
  stack.extent = {first.extent[0], first.extent[1], static_cast<std::int64_t>(slices.size())};
  stack.type = as_double ? SampleType::f64 : first.type;
  if (!as_double) {
    stack.slope = first.slope;
    stack.intercept = first.intercept;
  }
  stack.axis = first.axis;
  stack.origin = first.origin;
  stack.space = first.space;
  stack.has_spacing = first.has_spacing;
  stack.allocate(paths[0]);
  const std::size_t slice_bytes = static_cast<std::size_t>(first.voxels()) * sample_bytes(stack.type);
  for (std::size_t s = 0; s < slices.size(); ++s) {
    append_slice(slices[s], as_double, stack.data.get() + s * slice_bytes);
    if (s > 0) slices[s].data.reset();
  }
  return stack;
}

}  // namespace treemarch
