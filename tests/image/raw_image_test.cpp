#include "treemarch/image/raw_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

template <class T>
RawImage slice_of(SampleType type, const std::vector<T>& values) {
  RawImage slice;
  slice.dim = 2;
  slice.extent = {static_cast<std::int64_t>(values.size()), 1, 1};
  slice.type = type;
  std::memcpy(slice.allocate(), values.data(), values.size() * sizeof(T));
  return slice;
}

/// All samples, read a few at a time.
template <class T>
std::vector<T> samples_of(const RawImage& image, std::size_t at_a_time) {
  std::vector<T> samples(static_cast<std::size_t>(image.voxels()));
  for (std::size_t i = 0; i < samples.size(); i += at_a_time)
    image.samples->read(reinterpret_cast<std::byte*>(&samples[i]), std::min(at_a_time, samples.size() - i) * sizeof(T));
  return samples;
}

TEST(CheckSize, RefusesWhatCannotBe) {
  const auto check = [](std::vector<std::int64_t> extent, std::int64_t stored, double ratio) {
    check_size("file", extent, 2, stored, ratio);
  };
  EXPECT_NO_THROW(check({10, 10, 10}, 2000, 1));
  EXPECT_NO_THROW(check({10, 10, 10}, 100, kDeflateRatio));
  EXPECT_NO_THROW(check({10, 10, 10}, -1, 1));
  EXPECT_THROW(check({10, 10, 10}, 1900, 1), Error);
  EXPECT_THROW(check({1000, 1000, 1000}, 100, kDeflateRatio), Error);
  EXPECT_THROW(check({10, 0, 10}, -1, 1), Error);
  EXPECT_THROW(check({10, -1, 10}, -1, 1), Error);
  EXPECT_THROW(check({std::int64_t{1} << 31, 1, 1}, -1, 1), Error);
  const std::int64_t largest = std::numeric_limits<std::int32_t>::max();
  EXPECT_THROW(check({largest, largest, largest, largest}, -1, 1), Error);
}

TEST(StackSlices, OfOneTypeKeepTheirBytes) {
  for (const std::size_t at_a_time : {1U, 2U, 4U, 6U}) {
    std::vector<RawImage> slices;
    slices.push_back(slice_of<std::uint16_t>(SampleType::u16, {1, 2, 3}));
    slices.push_back(slice_of<std::uint16_t>(SampleType::u16, {4, 5, 65535}));
    const RawImage stack = stack_slices(std::move(slices), {"a", "b"});
    ASSERT_EQ(stack.type, SampleType::u16);
    EXPECT_EQ(stack.extent, (std::array<std::int64_t, 3>{3, 1, 2}));
    EXPECT_EQ(samples_of<std::uint16_t>(stack, at_a_time), (std::vector<std::uint16_t>{1, 2, 3, 4, 5, 65535}));
  }
}

TEST(StackSlices, OfMixedTypesAndScalesKeepTheirValues) {
  std::vector<RawImage> slices;
  slices.push_back(slice_of<std::uint8_t>(SampleType::u8, {1, 2}));
  slices.push_back(slice_of<std::int16_t>(SampleType::i16, {-3, 4}));
  slices[1].slope = 2;
  slices[1].intercept = 1;
  const RawImage stack = stack_slices(std::move(slices), {"a", "b"});
  EXPECT_EQ(stack.slope, 1);
  ASSERT_EQ(stack.type, SampleType::f64);
  EXPECT_EQ(samples_of<double>(stack, 3), (std::vector<double>{1, 2, -5, 9}));
}

TEST(StackSlices, OfOtherSizesAreErrors) {
  std::vector<RawImage> slices;
  slices.push_back(slice_of<std::uint8_t>(SampleType::u8, {1, 2}));
  slices.push_back(slice_of<std::uint8_t>(SampleType::u8, {1, 2, 3}));
  EXPECT_THROW(stack_slices(std::move(slices), {"a", "b"}), Error);
}

}  // namespace
}  // namespace treemarch
