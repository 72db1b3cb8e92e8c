#include "treemarch/image/label_encoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

namespace treemarch {
namespace {

constexpr std::int32_t kLargest = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kSmallest = std::numeric_limits<std::int32_t>::min();

/// What encoding promises, checked one voxel at a time.
template <class T>
void expect_encoded(const std::vector<T>& values, const EncodedLabels& encoded) {
  ASSERT_EQ(encoded.voxels.size(), static_cast<std::int64_t>(values.size()));
  std::vector<std::int32_t> appeared;
  std::vector<bool> known(encoded.labels.size(), false);
  std::int64_t changes = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::uint32_t m = encoded.voxels[static_cast<std::int64_t>(i)];
    ASSERT_LT(m, encoded.labels.size());
    ASSERT_EQ(encoded.labels[m], static_cast<std::int32_t>(values[i])) << "voxel " << i;
    if (!known[m]) appeared.push_back(encoded.labels[m]);
    known[m] = true;
    changes += i > 0 && values[i] != values[i - 1] ? 1 : 0;
  }
  EXPECT_EQ(appeared, encoded.labels);
  EXPECT_EQ(changes, encoded.changes);
}

/// Values added in stretches of the given sizes, the last of which stands for all that are left.
template <class T>
EncodedLabels encode(const std::vector<T>& values, const Execution& execution,
                     const std::vector<std::size_t>& stretches = {}) {
  LabelEncoder encoder(std::ssize(values), execution);
  std::span<const T> left(values);
  for (const std::size_t n : stretches) {
    encoder.add(left.first(n));
    left = left.subspan(n);
  }
  encoder.add(left);
  return encoder.take();
}

template <class T>
class EncodeLabels : public testing::Test {};
using IntegerTypes = testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t, std::uint32_t,
                                    std::int64_t, std::uint64_t>;
TYPED_TEST_SUITE(EncodeLabels, IntegerTypes);

TYPED_TEST(EncodeLabels, NumbersByFirstAppearanceWhateverTheThreads) {
  // Several blocks, long runs, and a label that appears in the last block alone.
  std::mt19937 random(7);
  const auto low = std::max<std::int64_t>(std::numeric_limits<TypeParam>::min(), -3000);
  const auto high = static_cast<std::int64_t>(
      std::min<std::uint64_t>(static_cast<std::uint64_t>(std::numeric_limits<TypeParam>::max()), 3000));
  std::uniform_int_distribution<std::int64_t> value(low, high - 1);
  std::vector<TypeParam> values;
  while (values.size() < 700'000) values.insert(values.end(), 1 + random() % 9, static_cast<TypeParam>(value(random)));
  values.back() = static_cast<TypeParam>(high);
  const EncodedLabels serial = encode<TypeParam>(values, Execution(1));
  expect_encoded(values, serial);
  const EncodedLabels parallel = encode<TypeParam>(values, Execution(4));
  expect_encoded(values, parallel);
  EXPECT_EQ(serial.labels.back(), high);
}

TEST(EncodeLabelsRange, TheWholeRangeOf32Bits) {
  std::vector<std::int32_t> values{kLargest, -1, kSmallest, 70000, 0, kLargest, kSmallest};
  values.resize(600'000, 5);
  values.push_back(kLargest - 1);
  expect_encoded(values, encode<std::int32_t>(values, Execution(2)));
}

TEST(EncodeLabelsRange, ManyLabelsTakeWiderVoxels) {
  std::vector<std::int32_t> values(70'000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::int32_t>(i * 7919 % values.size()) - 5;
  const EncodedLabels encoded = encode<std::int32_t>(values, Execution(2));
  EXPECT_EQ(encoded.voxels.width(), 4);
  expect_encoded(values, encoded);
  // However they come: the width grows on the way.
  expect_encoded(values, encode<std::int32_t>(values, Execution(2), {200, 0, 1, 60, 60'000, 9'000}));
}

}  // namespace
}  // namespace treemarch
