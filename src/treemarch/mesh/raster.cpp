#include "treemarch/mesh/raster.h"

#include <png.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr int kBandRows = 32;

Colour mix(const Colour& a, const Colour& b, float t) {
  Colour c;
  for (int i = 0; i < 3; ++i) c[i] = a[i] + t * (b[i] - a[i]);
  return c;
}

/// Rows that a triangle touches, clipped to the picture.
std::array<int, 2> rows_of(const ScreenTriangle& t, int height) {
  const auto [low, high] = std::minmax({t.corner[0][1], t.corner[1][1], t.corner[2][1]});
  return {std::max(0, static_cast<int>(std::floor(low))), std::min(height, static_cast<int>(std::ceil(high)) + 1)};
}

void draw(const ScreenTriangle& t, int first_row, int last_row, float line_width, Raster& raster) {
  const auto& [a, b, c] = t.corner;
  const float area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  if (!(std::abs(area) > 1e-6F)) return;
  // Weights of the corners grow linearly over the picture: w = at + dx * x + dy * y.
  std::array<float, 3> dx, dy, at, height;
  for (int i = 0; i < 3; ++i) {
    const auto& p = t.corner[(i + 1) % 3];
    const auto& q = t.corner[(i + 2) % 3];
    dx[i] = (p[1] - q[1]) / area;
    dy[i] = (q[0] - p[0]) / area;
    at[i] = (p[0] * q[1] - p[1] * q[0]) / area;
    height[i] = 1 / std::hypot(dx[i], dy[i]);  // distance of the corner from the opposite side
  }
  // Lines would cover a small triangle whole: let them fade with its size.
  const float size = std::min({height[0], height[1], height[2]}) / line_width;
  const float strength = 0.75F * std::clamp((size - 1.5F) / 6, 0.0F, 1.0F);
  constexpr Colour kLine{0.02F, 0.025F, 0.035F};

  const auto [left, right] = std::minmax({a[0], b[0], c[0]});
  const int x_begin = std::max(0, static_cast<int>(std::floor(left)));
  const int x_end = std::min(raster.width, static_cast<int>(std::ceil(right)) + 1);
  for (int y = first_row; y < last_row; ++y) {
    for (int x = x_begin; x < x_end; ++x) {
      const float px = static_cast<float>(x) + 0.5F, py = static_cast<float>(y) + 0.5F;
      std::array<float, 3> w;
      for (int i = 0; i < 3; ++i) w[i] = at[i] + dx[i] * px + dy[i] * py;
      if (w[0] < 0 || w[1] < 0 || w[2] < 0) continue;
      const float z = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
      const std::size_t pixel = static_cast<std::size_t>(y) * raster.width + x;
      if (z <= raster.depth[pixel]) continue;
      raster.depth[pixel] = z;
      float line = 0;
      for (int i = 0; i < 3; ++i)
        if (t.edge[i]) line = std::max(line, 1 - w[i] * height[i] / line_width);
      raster.colour[pixel] = mix(t.colour, kLine, strength * std::min(1.0F, 2 * line));
    }
  }
}

float encoded(float linear) {
  const float x = std::clamp(linear, 0.0F, 1.0F);
  return x <= 0.0031308F ? 12.92F * x : 1.055F * std::pow(x, 1 / 2.4F) - 0.055F;
}

/// Mean over [i - radius, i + radius], clipped, along a line of `n` values `stride` apart.
void blur_line(const float* from, float* to, int n, std::ptrdiff_t stride, int radius) {
  double sum = 0;
  for (int i = 0; i < std::min(radius, n); ++i) sum += from[i * stride];
  for (int i = 0; i < n; ++i) {
    if (i + radius < n) sum += from[(i + radius) * stride];
    if (i - radius - 1 >= 0) sum -= from[(i - radius - 1) * stride];
    const int count = std::min(n - 1, i + radius) - std::max(0, i - radius) + 1;
    to[i * stride] = static_cast<float>(sum / count);
  }
}

}  // namespace

Raster rasterise(std::span<const ScreenTriangle> triangles, int width, int height, float line_width,
                 const Execution& execution) {
  Raster raster{width, height, {}, {}};
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  raster.colour.resize(pixels);
  raster.depth.assign(pixels, Raster::kNothing);

  // Bands of rows are drawn in parallel: sort the triangles into them.
  const std::int64_t bands = block_count(height, kBandRows);
  std::vector<std::int64_t> begin(static_cast<std::size_t>(bands) + 1);
  auto for_each_band = [&](const ScreenTriangle& t, auto&& use) {
    const auto [first, last] = rows_of(t, height);
    if (first < last)
      for (int b = first / kBandRows; b <= (last - 1) / kBandRows; ++b) use(b);
  };
  for (const ScreenTriangle& t : triangles) for_each_band(t, [&](int b) { ++begin[b]; });
  std::vector<std::uint32_t> order(static_cast<std::size_t>(exclusive_scan(std::span(begin))));
  std::vector<std::int64_t> cursor = begin;
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for_each_band(triangles[i], [&](int b) { order[cursor[b]++] = static_cast<std::uint32_t>(i); });

  parallel_for(execution, bands, 1, [&](std::int64_t b) {
    const int band_first = static_cast<int>(b) * kBandRows;
    for (std::int64_t k = begin[b]; k < begin[b + 1]; ++k) {
      const ScreenTriangle& t = triangles[order[k]];
      const auto [first, last] = rows_of(t, height);
      draw(t, std::max(first, band_first), std::min(last, band_first + kBandRows), line_width, raster);
    }
  });
  return raster;
}

Raster reduced(const Raster& raster, const Colour& top, const Colour& bottom, const Execution& execution) {
  Raster small{raster.width / 2, raster.height / 2, {}, {}};
  small.colour.resize(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height));
  small.depth.resize(small.colour.size());
  parallel_for(execution, small.height, 16, [&](std::int64_t y) {
    const Colour behind = mix(top, bottom, static_cast<float>(y) / static_cast<float>(small.height));
    for (int x = 0; x < small.width; ++x) {
      Colour sum{};
      float depth = Raster::kNothing;
      for (int k = 0; k < 4; ++k) {
        const std::size_t from = static_cast<std::size_t>(2 * y + k / 2) * raster.width + 2 * x + k % 2;
        depth = std::max(depth, raster.depth[from]);
        const Colour& c = raster.depth[from] == Raster::kNothing ? behind : raster.colour[from];
        for (int i = 0; i < 3; ++i) sum[i] += 0.25F * c[i];
      }
      const std::size_t to = static_cast<std::size_t>(y) * small.width + x;
      small.colour[to] = sum;
      small.depth[to] = depth;
    }
  });
  return small;
}

void darken_hollows(Raster& raster, int radius, float scale, const Execution& execution) {
  float lowest = 0;
  for (const float d : raster.depth)
    if (d != Raster::kNothing) lowest = std::min(lowest, d);
  std::vector<float> mean = raster.depth;
  for (float& d : mean)
    if (d == Raster::kNothing) d = lowest - scale;
  std::vector<float> other(mean.size());
  for (int pass = 0; pass < 2; ++pass) {  // twice a box is close to a bell
    parallel_for(execution, raster.height, 16, [&](std::int64_t y) {
      blur_line(&mean[y * raster.width], &other[y * raster.width], raster.width, 1, radius);
    });
    parallel_for(execution, raster.width, 16,
                 [&](std::int64_t x) { blur_line(&other[x], &mean[x], raster.height, raster.width, radius); });
  }
  parallel_for(execution, static_cast<std::int64_t>(mean.size()), 1 << 14, [&](std::int64_t i) {
    if (raster.depth[i] == Raster::kNothing) return;
    const float hollow = std::clamp((mean[i] - raster.depth[i]) / scale, 0.0F, 1.0F);
    for (float& c : raster.colour[i]) c *= 1 - 0.6F * hollow;
  });
}

std::vector<std::uint8_t> encode_png(const Raster& raster) {
  std::vector<std::uint8_t> pixels;
  pixels.reserve(3 * raster.colour.size());
  for (const Colour& c : raster.colour)
    for (const float x : c) pixels.push_back(static_cast<std::uint8_t>(std::lround(255 * encoded(x))));
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(raster.width);
  image.height = static_cast<png_uint_32>(raster.height);
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> file(PNG_IMAGE_PNG_SIZE_MAX(image));
  png_alloc_size_t size = file.size();
  if (!png_image_write_to_memory(&image, file.data(), &size, 0, pixels.data(), 0, nullptr))
    throw Error(ErrorKind::limits, std::string("picture: ") + image.message);
  file.resize(size);
  return file;
}

Colour label_colour(std::int32_t label) {
  // Hues by the golden ratio stay apart for any run of labels; lightness and chroma vary with other irrational steps.
  const auto fraction = [&](double step) {
    const double x = step * static_cast<double>(label);
    return x - std::floor(x);
  };
  const double hue = 2 * std::numbers::pi * (fraction(0.6180339887498949) + 0.06);
  const double lightness = 0.66 + 0.14 * fraction(0.7548776662466927);
  const double chroma = 0.10 + 0.05 * fraction(0.5698402909980532);
  // OKLab to linear sRGB, a space in which equal lightness looks equally light.
  const double a = chroma * std::cos(hue), b = chroma * std::sin(hue);
  const double l = std::pow(lightness + 0.3963377774 * a + 0.2158037573 * b, 3);
  const double m = std::pow(lightness - 0.1055613458 * a - 0.0638541728 * b, 3);
  const double s = std::pow(lightness - 0.0894841775 * a - 1.2914855480 * b, 3);
  const double rgb[] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
                        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
                        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s};
  Colour colour;
  for (int i = 0; i < 3; ++i) colour[i] = static_cast<float>(std::clamp(rgb[i], 0.0, 1.0));
  return colour;
}

}  // namespace treemarch
