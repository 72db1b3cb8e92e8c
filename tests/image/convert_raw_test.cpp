#include "treemarch/image/convert_raw.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

using ::testing::HasSubstr;

template <class T>
RawImage line_of(SampleType type, const std::vector<T>& values) {
  RawImage raw;
  raw.extent = {static_cast<std::int64_t>(values.size()), 1, 1};
  raw.type = type;
  std::memcpy(raw.allocate(), values.data(), values.size() * sizeof(T));
  return raw;
}

std::string error_with(RawImage raw, const LabelRules& rules = {}) {
  const Execution execution(2);
  try {
    convert_labels("file", raw, 0, 1, rules, execution);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

TEST(ConvertLabels, TheLimitsOf32Bits) {
  constexpr std::int64_t kLargest = std::numeric_limits<std::int32_t>::max();
  constexpr std::int64_t kSmallest = std::numeric_limits<std::int32_t>::min();
  EXPECT_EQ(error_with(line_of<std::int64_t>(SampleType::i64, {kLargest, kSmallest, 0})), "");
  EXPECT_THAT(error_with(line_of<std::int64_t>(SampleType::i64, {0, kLargest + 1})),
              ::testing::AllOf(HasSubstr("2147483648"), HasSubstr("(1, 0, 0)")));
  EXPECT_THAT(error_with(line_of<std::int64_t>(SampleType::i64, {kSmallest - 1})), HasSubstr("-2147483649"));
  EXPECT_THAT(error_with(line_of<std::uint32_t>(SampleType::u32, {1U << 31})), HasSubstr("2147483648"));
  EXPECT_THAT(error_with(line_of<std::uint64_t>(SampleType::u64, {~0ULL})), HasSubstr("18446744073709551615"));
  EXPECT_EQ(error_with(line_of<double>(SampleType::f64, {2147483647.0, -2147483648.0})), "");
  EXPECT_THAT(error_with(line_of<double>(SampleType::f64, {2147483648.0})), HasSubstr("32-bit"));
  EXPECT_THAT(error_with(line_of<float>(SampleType::f32, {2147483648.0F})), HasSubstr("32-bit"));
}

TEST(ConvertLabels, ValuesThatAreNoLabels) {
  EXPECT_THAT(error_with(line_of<float>(SampleType::f32, {1, 0.5F})), HasSubstr("--threshold"));
  for (const bool threshold : {false, true}) {
    LabelRules rules;
    if (threshold) rules.threshold = 0.5;
    EXPECT_THAT(error_with(line_of<double>(SampleType::f64, {1, std::nan("")}), rules), HasSubstr("NaN"));
  }
  EXPECT_THAT(error_with(line_of<float>(SampleType::f32, {1, INFINITY})), HasSubstr("infinite"));
  EXPECT_EQ(error_with(line_of<float>(SampleType::f32, {-0.0F, 3})), "");
}

TEST(ConvertLabels, ThresholdIsInclusive) {
  const Execution execution(1);
  RawImage raw = line_of<std::int16_t>(SampleType::i16, {-5, 62, 63, 64});
  const EncodedLabels labels = convert_labels("file", raw, 0, 1, {.threshold = 63}, execution);
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < 4; ++i) values.push_back(labels.labels[labels.voxels[i]]);
  EXPECT_EQ(values, (std::vector<std::int32_t>{0, 0, 1, 1}));
  EXPECT_THAT(error_with(line_of<std::int16_t>(SampleType::i16, {-5, 62}), {.threshold = 63}),
              HasSubstr("largest value is 62"));
}

TEST(ConvertLabels, GreyImagesAreToldFromLabelsByTheirNeighbours) {
  std::mt19937 random(5);
  std::vector<std::uint8_t> grey(20'000), blocks(20'000);
  for (std::size_t i = 0; i < grey.size(); ++i) {
    grey[i] = static_cast<std::uint8_t>(random());
    blocks[i] = static_cast<std::uint8_t>(i % 3 ? blocks[i - 1] : random());
  }
  EXPECT_THAT(error_with(line_of(SampleType::u8, grey)), HasSubstr("--threshold"));
  EXPECT_EQ(error_with(line_of(SampleType::u8, grey), {.any_labels = true}), "");
  EXPECT_EQ(error_with(line_of(SampleType::u8, grey), {.threshold = 9}), "");
  EXPECT_EQ(error_with(line_of(SampleType::u8, blocks)), "");
}

TEST(ConvertLabels, ImagesOfSeveralSlabs) {
  // Two labels appear in the second slab alone.
  constexpr std::size_t kSlab = std::size_t{32} << 20;
  std::vector<std::uint8_t> values(kSlab + 1000, 7);
  values[kSlab + 3] = 9;
  values[kSlab + 4] = 8;
  RawImage raw = line_of(SampleType::u8, values);
  const Execution execution(2);
  const EncodedLabels labels = convert_labels("file", raw, 0, 1, {}, execution);
  EXPECT_EQ(labels.labels, (std::vector<std::int32_t>{7, 9, 8}));
  EXPECT_EQ(labels.changes, 3);
  ASSERT_EQ(labels.voxels.size(), std::ssize(values));
  EXPECT_EQ(labels.voxels[kSlab + 3], 1U);
  EXPECT_EQ(labels.voxels[kSlab + 999], 0U);

  std::vector<double> grey(kSlab / 8 + 10, 1);
  grey[kSlab / 8 + 5] = 1.5;
  const std::string place = "(" + std::to_string(kSlab / 8 + 5) + ", 0, 0)";
  EXPECT_THAT(error_with(line_of(SampleType::f64, grey)), HasSubstr(place));
  EXPECT_THAT(error_with(line_of(SampleType::f64, grey), {.threshold = 2}), HasSubstr("largest value is 1.5"));
  RawImage grey_raw = line_of(SampleType::f64, grey);
  EXPECT_EQ(convert_grey("file", grey_raw, 0, execution)[kSlab / 8 + 5], 1.5F);
}

/// Two volumes of which the file ends too early.
class CutShort : public SampleStream {
 public:
  void read(std::byte* to, std::size_t bytes) override {
    if (at_ + bytes > 7) throw Error(ErrorKind::input, "file: is cut short; get a complete copy");
    std::fill_n(to, bytes, std::byte{1});
    at_ += bytes;
  }

 private:
  std::size_t at_ = 0;
};

TEST(ConvertLabels, WhatIsWrongWithTheFileComesFirst) {
  RawImage raw;
  raw.extent = {2, 2, 1};
  raw.volumes = 2;
  raw.type = SampleType::u8;
  raw.slope = 0.5;  // no labels
  raw.samples = std::make_unique<CutShort>();
  EXPECT_THAT(error_with(std::move(raw)), HasSubstr("cut short"));
}

TEST(MakeFrame, ColumnsBecomeSpacingAndDirection) {
  RawImage raw = line_of<std::uint8_t>(SampleType::u8, {0});
  raw.axis = {{{3, 4, 0}, {0, -2, 0}, {0, 1, 1}}};
  raw.origin = {1, 2, 3};
  const Frame<3> frame = make_frame<3>("file", raw);
  EXPECT_NEAR(frame.spacing[0], 5, 1e-12);
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      EXPECT_NEAR(frame.direction[c][r] * frame.spacing[c],
                  raw.axis[static_cast<std::size_t>(c)][static_cast<std::size_t>(r)], 1e-12);
}

TEST(MakeFrame, RefusesWhatIsNoFrame) {
  const auto error = [](const std::function<void(RawImage&)>& change) -> std::string {
    RawImage raw = line_of<std::uint8_t>(SampleType::u8, {0});
    change(raw);
    try {
      make_frame<3>("file", raw);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(error([](RawImage&) {}), "");
  EXPECT_THAT(error([](RawImage& r) { r.axis[1] = {}; }), HasSubstr("spacing of axis 2 is 0"));
  EXPECT_THAT(error([](RawImage& r) { r.axis[1][1] = std::nan(""); }), HasSubstr("not a number"));
  EXPECT_THAT(error([](RawImage& r) { r.origin[2] = INFINITY; }), HasSubstr("not a number"));
  EXPECT_THAT(error([](RawImage& r) { r.axis[1] = {2, 0, 0}; }), HasSubstr("singular"));
}

TEST(OverrideSpacing, OnlyWhereTheFileHasNone) {
  RawImage raw = line_of<std::uint8_t>(SampleType::u8, {0});
  EXPECT_THROW(override_spacing("file", std::vector<double>{1, 1, 1}, raw), Error);
  raw.has_spacing = false;
  EXPECT_THROW(override_spacing("file", std::vector<double>{1, 1}, raw), Error);
  EXPECT_THROW(override_spacing("file", std::vector<double>{1, 0, 1}, raw), Error);
  override_spacing("file", std::vector<double>{1, 2, 3}, raw);
  EXPECT_EQ(make_frame<3>("file", raw).spacing, (Vec<3>{1, 2, 3}));
  EXPECT_TRUE(raw.has_spacing);
}

}  // namespace
}  // namespace treemarch
