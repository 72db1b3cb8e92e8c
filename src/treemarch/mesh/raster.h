/// \file
/// A small rasteriser: triangles with a depth buffer, their edges as thin lines.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"

namespace treemarch {

/// Red, green and blue, linear light, in [0, 1].
using Colour = std::array<float, 3>;

struct ScreenTriangle {
  /// Pixels from the left and from the top, and depth: the larger, the nearer.
  std::array<std::array<float, 3>, 3> corner;
  std::array<bool, 3> edge{true, true, true};  ///< whether the side opposite of a corner is drawn
  Colour colour{};
};

/// Pixels in rows from the top.
struct Raster {
  int width = 0, height = 0;
  std::vector<Colour> colour;
  std::vector<float> depth;  ///< kNothing where nothing was drawn
  static constexpr float kNothing = -1e30F;
};

/// Draws triangles; where several are equally near, the first wins.
/// \param line_width of edges, in pixels; edges of triangles that are hardly larger fade out.
Raster rasterise(std::span<const ScreenTriangle> triangles, int width, int height, float line_width,
                 const Execution& execution);

/// Half the size: the mean of each 2 x 2 pixels, on a background that goes from `top` to `bottom`. The depth is that of
/// the nearest of them.
Raster reduced(const Raster& raster, const Colour& top, const Colour& bottom, const Execution& execution);

/// Darkens what lies behind its surroundings, as if less light came there: contours and hollows become visible.
/// \param radius of the surroundings in pixels. \param scale the difference of depth at which it is darkest.
void darken_hollows(Raster& raster, int radius, float scale, const Execution& execution);

/// A PNG file, 8 bits a channel.
std::vector<std::uint8_t> encode_png(const Raster& raster);

/// A pleasant colour for a label: always the same one, and different for labels that follow each other.
Colour label_colour(std::int32_t label);

}  // namespace treemarch
