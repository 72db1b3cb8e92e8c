#include "treemarch/image/convert_raw.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = std::int64_t{1} << 18;
constexpr std::int64_t kSlabBytes = std::int64_t{32} << 20;  // of samples in memory at a time
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

/// Calls use(samples, first) for the samples of consecutive volumes, a slab at a time in scan order; first counts from
/// the first of those volumes. What the file says of itself at its end (cut short, damaged) comes before what is wrong
/// with a value.
template <class T, class Use>
void for_slabs(RawImage& raw, std::int64_t first_volume, std::int64_t volumes, const Execution& execution, Use&& use) {
  const std::int64_t all = raw.voxels() * raw.volumes, begin = first_volume * raw.voxels(),
                     end = begin + volumes * raw.voxels();
  const std::int64_t most = std::min<std::int64_t>(all, kSlabBytes / sizeof(T));
  const auto slab = std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(most));
  std::optional<Error> wrong;
  for (std::int64_t at = 0; at < all; at += most) {
    execution.check();
    const std::int64_t last = std::min(all, at + most);
    raw.samples->read(reinterpret_cast<std::byte*>(slab.get()), static_cast<std::size_t>(last - at) * sizeof(T));
    const std::int64_t from = std::max(at, begin), to = std::min(last, end);
    if (from >= to || wrong) continue;
    try {
      use(std::span<const T>(slab.get() + (from - at), static_cast<std::size_t>(to - from)), from - begin);
    } catch (const Error& e) {
      wrong = e;
    }
  }
  if (wrong) throw Error(*wrong);
}

/// In label images most voxels have the label of their neighbour (0.95 and more on real ones), in grey images few have
/// (0.03 to 0.06 on CT and micro-CT).
bool looks_grey(const EncodedLabels& encoded) {
  const std::int64_t n = encoded.voxels.size();
  return n >= 4096 && encoded.labels.size() > 100 && encoded.changes > n / 2;
}

/// Turns samples of a type into labels, a slab after the other.
template <class T>
class LabelConverter {
 public:
  LabelConverter(const std::string& path, const RawImage& raw, std::int64_t size, const LabelRules& rules,
                 const Execution& execution)
      : path_(path), raw_(raw), rules_(rules), execution_(execution), encoder_(size, execution) {}

  /// \param first number of the first sample
  void add(std::span<const T> samples, std::int64_t first) {
    if (rules_.threshold)
      add_thresholded(samples, first);
    else if (std::is_floating_point_v<T> || raw_.slope != 1 || raw_.intercept != 0)
      add_values(samples, first);
    else
      add_integers(samples, first);
  }

  EncodedLabels take() {
    EncodedLabels encoded = encoder_.take();
    if (rules_.threshold && std::ranges::find(encoded.labels, 1) == encoded.labels.end())
      fail(path_, "no voxel reaches the threshold " + text_of(*rules_.threshold) + "; its largest value is " +
                      text_of(largest_));
    if (!rules_.any_labels && !rules_.threshold && looks_grey(encoded))
      fail(path_,
           "looks like a grey image (" + std::to_string(encoded.labels.size()) +
               " values, most voxels differ from their neighbour); give --threshold T to make a label image of it");
    return encoded;
  }

 private:
  [[nodiscard]] double value(T sample) const { return raw_.slope * static_cast<double>(sample) + raw_.intercept; }
  /// The first sample for which bad(sample) holds, or null.
  template <class Bad>
  const T* find(std::span<const T> samples, Bad&& bad) const {
    const std::int64_t i = first_bad(execution_, std::ssize(samples),
                                     [&](std::int64_t k) { return bad(samples[static_cast<std::size_t>(k)]); });
    return i == kNone ? nullptr : &samples[static_cast<std::size_t>(i)];
  }

  void add_integers(std::span<const T> samples, std::int64_t first) {
    if constexpr (std::is_integral_v<T>) {
      if constexpr (sizeof(T) >= 4 && !std::is_same_v<T, std::int32_t>)
        if (const T* bad = find(samples, [](T v) { return !std::in_range<std::int32_t>(v); }))
          fail(path_, "the label " + std::to_string(*bad) + " at " + voxel_text(raw_, first + (bad - samples.data())) +
                          " does not fit a signed 32-bit integer; renumber the labels");
      encoder_.add(samples);
    }
  }
  /// By way of double: floating-point samples, and scaled ones.
  void add_values(std::span<const T> samples, std::int64_t first) {
    if (const T* bad = find(samples, [&](T v) { return !is_label(value(v)); }))
      fail_value(path_, raw_, first + (bad - samples.data()), value(*bad));
    labels_.resize(samples.size());
    parallel_for(execution_, std::ssize(samples), kBlock, [&](std::int64_t i) {
      labels_[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(value(samples[static_cast<std::size_t>(i)]));
    });
    encoder_.add(std::span<const std::int32_t>(labels_));
  }
  void add_thresholded(std::span<const T> samples, std::int64_t first) {
    if constexpr (std::is_floating_point_v<T>)
      if (const T* bad = find(samples, [&](T v) { return std::isnan(value(v)); }))
        fail_value(path_, raw_, first + (bad - samples.data()), value(*bad));
    above_.resize(samples.size());
    largest_ = std::max(largest_, parallel_reduce(
                                      execution_, std::ssize(samples), kBlock, value(samples[0]),
                                      [&](std::int64_t begin, std::int64_t end) {
                                        double largest = value(samples[static_cast<std::size_t>(begin)]);
                                        for (auto i = static_cast<std::size_t>(begin); std::cmp_less(i, end); ++i) {
                                          const double v = value(samples[i]);
                                          largest = std::max(largest, v);
                                          above_[i] = v >= *rules_.threshold ? 1 : 0;
                                        }
                                        return largest;
                                      },
                                      [](double a, double b) { return std::max(a, b); }));
    encoder_.add(std::span<const std::uint8_t>(above_));
  }

  const std::string& path_;
  const RawImage& raw_;
  const LabelRules& rules_;
  const Execution& execution_;
  LabelEncoder encoder_;
  std::vector<std::int32_t> labels_;
  std::vector<std::uint8_t> above_;
  double largest_ = -std::numeric_limits<double>::infinity();
};

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

EncodedLabels convert_labels(const std::string& path, RawImage& raw, std::int64_t first_volume, std::int64_t volumes,
                             const LabelRules& rules, const Execution& execution) {
  return visit_type(raw.type, [&]<class T>(T) {
    LabelConverter<T> converter(path, raw, volumes * raw.voxels(), rules, execution);
    for_slabs<T>(raw, first_volume, volumes, execution,
                 [&](std::span<const T> samples, std::int64_t first) { converter.add(samples, first); });
    return converter.take();
  });
}

std::vector<float> convert_grey(const std::string& path, RawImage& raw, std::int64_t volume,
                                const Execution& execution) {
  std::vector<float> values;
  values.reserve(static_cast<std::size_t>(raw.voxels()));
  visit_type(raw.type, [&]<class T>(T) {
    for_slabs<T>(raw, volume, 1, execution, [&](std::span<const T> samples, std::int64_t first) {
      values.resize(values.size() + samples.size());
      float* const to = values.data() + first;
      parallel_for(execution, std::ssize(samples), kBlock, [&](std::int64_t i) {
        to[i] =
            static_cast<float>(raw.slope * static_cast<double>(samples[static_cast<std::size_t>(i)]) + raw.intercept);
      });
      const std::int64_t bad =
          first_bad(execution, std::ssize(samples), [&](std::int64_t i) { return !std::isfinite(to[i]); });
      if (bad != kNone) fail_value(path, raw, first + bad, static_cast<double>(to[bad]));
    });
  });
  return values;
}

template Frame<2> make_frame(const std::string&, const RawImage&);
template Frame<3> make_frame(const std::string&, const RawImage&);
template Frame<4> make_frame(const std::string&, const RawImage&);

}  // namespace treemarch
