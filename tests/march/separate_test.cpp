#include "treemarch/march/separate.h"

#include <gtest/gtest.h>

#include <random>

namespace treemarch {
namespace {

LabelImage<3> noise_image() {
  std::mt19937 random(4);
  std::vector<std::int32_t> values(5 * 4 * 3);
  for (auto& v : values) v = static_cast<std::int32_t>(random() % 4);
  Frame<3> frame;
  frame.spacing = {0.5, 1.0, 2.0};
  return make_label_image<3>({5, 4, 3}, values, frame);
}

std::vector<double> shares(const LabelImage<3>& image, const Vec<3>& at) {
  const auto field = linear_field(image);
  std::vector<double> p(image.labels.size());
  for (MaterialId m = 0; m < p.size(); ++m) field(m, {&at, 1}, {&p[m], 1});
  return p;
}

TEST(LinearField, IsTheIndicatorAtVoxelCentres) {
  const auto image = noise_image();
  for (std::int64_t i = 0; i < 60; ++i) {
    const Coord<3> c = coord_of(i, image.extent);
    const auto p = shares(image, {(c[0] + 0.5) * 0.5, (c[1] + 0.5) * 1.0, (c[2] + 0.5) * 2.0});
    for (MaterialId m = 0; m < p.size(); ++m) EXPECT_EQ(p[m], image.material(c) == m ? 1 : 0);
  }
}

TEST(LinearField, SharesAddUpToOneAlsoBeyondTheCentres) {
  const auto image = noise_image();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-0.5, 7);
  for (int i = 0; i < 500; ++i) {
    const auto p = shares(image, {u(random), u(random), u(random)});
    double sum = 0;
    for (const double x : p) {
      EXPECT_GE(x, 0);
      sum += x;
    }
    EXPECT_NEAR(sum, 1, 1e-14);
  }
}

TEST(LinearField, IsLinearBetweenTwoCentresAndMeanAtVoxelCorners) {
  const auto image = noise_image();
  for (const double t : {0.0, 0.25, 0.7, 1.0}) {
    const auto a = shares(image, {0.75, 1.5, 3});
    const auto b = shares(image, {1.25, 1.5, 3});
    const auto p = shares(image, {0.75 + 0.5 * t, 1.5, 3});
    for (std::size_t m = 0; m < p.size(); ++m) EXPECT_NEAR(p[m], (1 - t) * a[m] + t * b[m], 1e-14);
  }
  std::vector<double> mean(image.labels.size(), 0.0);
  for (int corner = 0; corner < 8; ++corner) {
    mean[image.material({1 + (corner & 1), 1 + (corner >> 1 & 1), 1 + (corner >> 2)})] += 0.125;
  }
  const auto p = shares(image, {1, 2, 4});
  for (std::size_t m = 0; m < p.size(); ++m) EXPECT_NEAR(p[m], mean[m], 1e-14);
}

TEST(LinearField, AnImageOneVoxelThickIsConstantAcross) {
  const auto image = make_label_image<2>({3, 1}, {5, 6, 5});
  const auto field = linear_field(image);
  const std::vector<Vec<2>> points = {{1.5, 0}, {1.5, 0.5}, {1.5, 1}, {1, 0.9}};
  std::vector<double> p(points.size());
  field(1, points, p);
  EXPECT_EQ(p[0], 1);
  EXPECT_EQ(p[1], 1);
  EXPECT_EQ(p[2], 1);
  EXPECT_DOUBLE_EQ(p[3], 0.5);
}

}  // namespace
}  // namespace treemarch
