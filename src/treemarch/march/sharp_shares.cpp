#include "treemarch/march/sharp_shares.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace treemarch {
namespace {

constexpr double kSharpening = 2;

/// Four voxels in a row, the place between the second and the third: how far apart they are stored, and their weights.
struct Taps {
  std::array<std::int64_t, 4> index;
  std::array<double, 4> linear, smooth;  // L and S L of one axis
};

Taps taps_at(double place, std::int32_t extent, std::int64_t stride) {
  const double u = std::clamp(place - 0.5, 0.0, extent - 1.0);
  // The last cell is taken with fraction 1, so that there are two voxels wherever the image has them.
  const double cell = std::min(std::floor(u), std::max(0.0, extent - 2.0));
  const double high = u - cell, low = 1 - high;
  Taps taps{{}, {0, low, high, 0}, {0.25 * low, 0.5 * low + 0.25 * high, 0.25 * low + 0.5 * high, 0.25 * high}};
  for (int k = 0; k < 4; ++k)
    taps.index[k] = stride * std::clamp(static_cast<std::int32_t>(cell) - 1 + k, 0, extent - 1);
  return taps;
}

/// Adds up over the axes from `Axis` down. \param linear, smooth products of the weights so far
template <int Axis, int Dim>
double sum(const LabelImage<Dim>& image, MaterialId material, const std::array<Taps, Dim>& taps, std::int64_t index,
           double linear, double smooth) {
  if constexpr (Axis < 0) {
    return image.voxels[index] == material ? (1 + kSharpening) * linear - kSharpening * smooth : 0;
  } else {
    double result = 0;
    const auto& weights = Axis == Dim - 1 ? taps[Axis].linear : taps[Axis].smooth;
    for (int k = 0; k < 4; ++k)
      if (weights[k] > 0)
        result += sum<Axis - 1, Dim>(image, material, taps, index + taps[Axis].index[k], linear * taps[Axis].linear[k],
                                     smooth * weights[k]);
    return result;
  }
}

}  // namespace

template <int Dim>
MaterialField<Dim> sharp_shares(const LabelImage<Dim>& image) {
  return [&image](MaterialId material, std::span<const Vec<Dim>> points, std::span<double> values) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      std::array<Taps, Dim> taps;
      std::int64_t stride = 1;
      for (int d = 0; d < Dim; stride *= image.extent[d++])
        taps[d] = taps_at(points[i][d] / image.frame.spacing[d], image.extent[d], stride);
      values[i] = sum<Dim - 1, Dim>(image, material, taps, 0, 1, 1);
    }
  };
}

template MaterialField<4> sharp_shares<4>(const LabelImage<4>&);

}  // namespace treemarch
