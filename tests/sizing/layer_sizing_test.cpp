#include "treemarch/sizing/layer_sizing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/images.h"

namespace treemarch {
namespace {

template <class Label>
LabelImage<3> painted(const Coord<3>& extent, const Frame<3>& frame, Label&& label) {
  std::vector<std::int32_t> values;
  for (std::int64_t i = 0; i < product(extent); ++i) values.push_back(label(coord_of(i, extent)));
  return make_label_image<3>(extent, values, frame);
}

TEST(LayerSizes, PlatesOfAnyThickness) {
  for (const int thickness : {1, 2, 3, 5}) {
    const auto image =
        painted({24, 24, 24}, {}, [&](const Coord<3>& c) { return c[2] >= 9 && c[2] < 9 + thickness ? 1 : 0; });
    const auto sizes = layer_sizes(image, 2, 0.25, 4, Execution(2));
    for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
      const bool plate = image.labels[image.voxels[i]] == 1;
      ASSERT_FLOAT_EQ(sizes[i], plate ? static_cast<float>(0.5 * thickness) : 0) << thickness << " at " << i;
    }
  }
}

TEST(LayerSizes, ShellsAreThinEverywhereAndBallsNowhere) {
  const auto distance = [](const Coord<3>& c) { return std::hypot(c[0] - 19.6, c[1] - 20.1, c[2] - 19.7); };
  const auto image = painted({40, 40, 40}, {}, [&](const Coord<3>& c) {
    const double r = distance(c);
    return r < 12 ? 1 : r < 14 ? 2 : 0;
  });
  const auto sizes = layer_sizes(image, 2, 0.25, 8, Execution(2));
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    const std::int32_t label = image.labels[image.voxels[i]];
    if (label == 2) {  // two voxels, along the axes: chords of one to three
      ASSERT_GE(sizes[i], 0.5F);
      ASSERT_LE(sizes[i], 1.5F);
    } else if (label == 1) {
      ASSERT_EQ(sizes[i], 0) << i;
    }
  }
}

TEST(LayerSizes, LengthsArePhysicalAndBounded) {
  Frame<3> frame;
  frame.spacing = {0.5, 0.5, 2};
  const auto image = painted({20, 20, 20}, frame, [](const Coord<3>& c) { return c[0] == 7 || c[2] == 12 ? 1 : 0; });
  const auto sizes = layer_sizes(image, 3, 0.25, 4, Execution(2));
  EXPECT_FLOAT_EQ(sizes[linear_index<3>({7, 10, 3}, image.extent)], 0.25);  // 0.5 / 3 is below the smallest
  EXPECT_FLOAT_EQ(sizes[linear_index<3>({15, 10, 12}, image.extent)], 2.0F / 3);
  EXPECT_EQ(layer_sizes(image, 3, 0.25, 4, Execution(1)), sizes);
  EXPECT_EQ(layer_sizes(image, 3, 0.25, 4, Execution(7)), sizes);
}

}  // namespace
}  // namespace treemarch
