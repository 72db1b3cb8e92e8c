#include "treemarch/image/convert_raw.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <type_traits>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = std::int64_t{1} << 18;
constexpr std::int64_t kNone = std::numeric_limits<std::int64_t>::max();

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

std::string text_of(double v) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.10g", v);
  return text.data();
}

double determinant(const std::array<std::array<double, 3>, 3>& m) {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/// First index in [0, n) for which bad(index) holds, kNone if there is none.
template <class Bad>
std::int64_t first_bad(const Execution& execution, std::int64_t n, Bad&& bad) {
  return parallel_reduce(
      execution, n, kBlock, kNone,
      [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i)
          if (bad(i)) return i;
        return kNone;
      },
      [](std::int64_t a, std::int64_t b) { return std::min(a, b); });
}

std::string voxel_text(const RawImage& raw, std::int64_t i) {
  i %= raw.voxels();
  std::string text = "voxel (";
  for (std::size_t d = 0; d < static_cast<std::size_t>(raw.dim); ++d) {
    text += (d ? ", " : "") + std::to_string(i % raw.extent[d]);
    i /= raw.extent[d];
  }
  return text + ")";
}

[[noreturn]] void fail_value(const std::string& path, const RawImage& raw, std::int64_t i, double value) {
  if (!std::isfinite(value))
    fail(path, "the value of " + voxel_text(raw, i) + " is " + (std::isnan(value) ? "NaN" : "infinite") +
                   "; replace such values");
  if (value != std::floor(value))
    fail(path, "holds grey values, not labels (" + text_of(value) + " at " + voxel_text(raw, i) +
                   "); give --threshold T to make a label image of it");
  fail(path, "the label " + text_of(value) + " at " + voxel_text(raw, i) +
                 " does not fit a signed 32-bit integer; renumber the labels");
}

constexpr bool is_label(double v) {
  return v >= std::numeric_limits<std::int32_t>::min() && v <= std::numeric_limits<std::int32_t>::max() &&
         v == static_cast<double>(static_cast<std::int32_t>(v));
}

/// Labels by way of double: floating-point samples, and scaled ones.
template <class T>
EncodedLabels encode_values(const std::string& path, const RawImage& raw, std::span<const T> samples,
                            const Execution& execution) {
  const auto n = static_cast<std::int64_t>(samples.size());
  const auto value = [&](std::int64_t i) {
    return raw.slope * static_cast<double>(samples[static_cast<std::size_t>(i)]) + raw.intercept;
  };
  const std::int64_t bad = first_bad(execution, n, [&](std::int64_t i) { return !is_label(value(i)); });
  if (bad != kNone) fail_value(path, raw, bad, value(bad));
  std::vector<std::int32_t> labels(samples.size());
  parallel_for(execution, n, kBlock,
               [&](std::int64_t i) { labels[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(value(i)); });
  return encode_labels(std::span<const std::int32_t>(labels), execution);
}

template <class T>
EncodedLabels encode_thresholded(const std::string& path, const RawImage& raw, std::span<const T> samples,
                                 double threshold, const Execution& execution) {
  const auto n = static_cast<std::int64_t>(samples.size());
  const auto value = [&](std::int64_t i) {
    return raw.slope * static_cast<double>(samples[static_cast<std::size_t>(i)]) + raw.intercept;
  };
  if constexpr (std::is_floating_point_v<T>) {
    const std::int64_t bad = first_bad(execution, n, [&](std::int64_t i) { return std::isnan(value(i)); });
    if (bad != kNone) fail_value(path, raw, bad, value(bad));
  }
  std::vector<std::uint8_t> labels(samples.size());
  parallel_for(execution, n, kBlock,
               [&](std::int64_t i) { labels[static_cast<std::size_t>(i)] = value(i) >= threshold ? 1 : 0; });
  EncodedLabels encoded = encode_labels(std::span<const std::uint8_t>(labels), execution);
  if (std::find(encoded.labels.begin(), encoded.labels.end(), 1) == encoded.labels.end()) {
    double largest = value(0);
    for (std::int64_t i = 1; i < n; ++i) largest = std::max(largest, value(i));
    fail(path, "no voxel reaches the threshold " + text_of(threshold) + "; its largest value is " + text_of(largest));
  }
  return encoded;
}

/// In label images most voxels have the label of their neighbour (0.95 and more on real ones), in grey images few have
/// (0.03 to 0.06 on CT and micro-CT).
bool looks_grey(const EncodedLabels& encoded) {
  const std::int64_t n = encoded.voxels.size();
  return n >= 4096 && encoded.labels.size() > 100 && encoded.changes > n / 2;
}

/// A side within the rounding of single precision of a number of six digits is that number: affines are often stored in
/// single precision, and the same voxels must mesh alike in every frame.
double without_rounding(double side) {
  constexpr double kSinglePrecision = 2e-7;
  const double scale = std::pow(10.0, 5 - std::floor(std::log10(side)));
  const double round = std::round(side * scale) / scale;
  return std::abs(round - side) <= kSinglePrecision * side ? round : side;
}

}  // namespace

template <int Dim>
Frame<Dim> make_frame(const std::string& path, const RawImage& raw) {
  Frame<Dim> frame;
  const auto dims = static_cast<std::size_t>(raw.dim);
  std::array<std::array<double, 3>, 3> unit{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (std::size_t c = 0; c < dims; ++c) {
    double length = 0;
    for (std::size_t r = 0; r < dims; ++r) length = std::hypot(length, raw.axis[c][r]);
    const std::string name = "axis " + std::to_string(c + 1);
    if (!std::isfinite(length) || !std::isfinite(raw.origin[c]))
      fail(path, "its spacing or origin along " + name + " is not a number; repair the header");
    if (!(length > 0)) fail(path, "the spacing of " + name + " is 0; repair the header");
    frame.spacing[c] = length = without_rounding(length);
    frame.origin[c] = raw.origin[c];
    for (std::size_t r = 0; r < dims; ++r) {
      unit[c][r] = raw.axis[c][r] / length;
      frame.direction[c][r] = unit[c][r];
    }
  }
  // The volume that unit steps along the axes span: 1 where they are orthogonal.
  if (std::abs(determinant(unit)) < 1e-6)
    fail(path, "its affine is singular (axes that do not span the space); repair the header");
  frame.space = raw.space;
  frame.has_spacing = raw.has_spacing;
  if (Dim > raw.dim) {
    frame.spacing[Dim - 1] = raw.volume_spacing;
    if (!frame.space.empty()) frame.space += 'T';
  }
  return frame;
}

void override_spacing(const std::string& path, std::span<const double> spacing, RawImage& raw) {
  if (raw.has_spacing)
    throw Error(ErrorKind::usage, "--spacing: " + path + " carries its own spacing; leave the option out");
  const auto dims = static_cast<std::size_t>(raw.dim);
  if (spacing.size() != 1 && spacing.size() != dims)
    throw Error(ErrorKind::usage, "--spacing: has " + std::to_string(spacing.size()) + " numbers, but " + path +
                                      " has " + std::to_string(dims) + " axes; give one number an axis or one for all");
  for (std::size_t c = 0; c < dims; ++c) {
    const double s = spacing[spacing.size() == 1 ? 0 : c];
    if (!(s > 0) || !std::isfinite(s))
      throw Error(ErrorKind::usage, "--spacing: " + text_of(s) + " is no spacing; give numbers above 0");
    raw.axis[c] = {};
    raw.axis[c][c] = s;
  }
  raw.has_spacing = true;
}

EncodedLabels convert_labels(const std::string& path, const RawImage& raw, std::int64_t first_volume,
                             std::int64_t volumes, const LabelRules& rules, const Execution& execution) {
  const bool scaled = raw.slope != 1 || raw.intercept != 0;
  EncodedLabels encoded = raw.visit(first_volume, volumes, [&]<class T>(std::span<const T> samples) {
    if (rules.threshold) return encode_thresholded(path, raw, samples, *rules.threshold, execution);
    if constexpr (std::is_floating_point_v<T>) {
      return encode_values(path, raw, samples, execution);
    } else {
      if (scaled) return encode_values(path, raw, samples, execution);
      if constexpr (sizeof(T) >= 4 && !std::is_same_v<T, std::int32_t>) {
        const std::int64_t bad = first_bad(execution, static_cast<std::int64_t>(samples.size()), [&](std::int64_t i) {
          return !std::in_range<std::int32_t>(samples[static_cast<std::size_t>(i)]);
        });
        if (bad != kNone)
          fail(path, "the label " + std::to_string(samples[static_cast<std::size_t>(bad)]) + " at " +
                         voxel_text(raw, bad) + " does not fit a signed 32-bit integer; renumber the labels");
      }
      return encode_labels(samples, execution);
    }
  });
  if (!rules.any_labels && !rules.threshold && looks_grey(encoded))
    fail(path, "looks like a grey image (" + std::to_string(encoded.labels.size()) +
                   " values, most voxels differ from their neighbour); give --threshold T to make a label image of it");
  return encoded;
}

std::vector<float> convert_grey(const std::string& path, const RawImage& raw, std::int64_t volume,
                                const Execution& execution) {
  return raw.visit(volume, 1, [&]<class T>(std::span<const T> samples) {
    std::vector<float> values(samples.size());
    const auto n = static_cast<std::int64_t>(samples.size());
    parallel_for(execution, n, kBlock, [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      values[at] = static_cast<float>(raw.slope * static_cast<double>(samples[at]) + raw.intercept);
    });
    const std::int64_t bad =
        first_bad(execution, n, [&](std::int64_t i) { return !std::isfinite(values[static_cast<std::size_t>(i)]); });
    if (bad != kNone) fail_value(path, raw, bad, static_cast<double>(values[static_cast<std::size_t>(bad)]));
    return values;
  });
}

template Frame<2> make_frame(const std::string&, const RawImage&);
template Frame<3> make_frame(const std::string&, const RawImage&);
template Frame<4> make_frame(const std::string&, const RawImage&);

}  // namespace treemarch
