#include "treemarch/field/kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace treemarch {
namespace {

TEST(Kernel, GaussiansHaveTheirSumAndVariance) {
  for (int sum : {256, 4096})
    for (double sigma = 0.25; sigma <= 4.3; sigma += 0.05) {
      const Kernel k = gaussian_kernel(sigma, sum);
      double total = k.tap[0];
      double variance = 0;
      for (int i = 1; i <= k.radius(); ++i) {
        EXPECT_EQ(k.tap[i], std::round(k.tap[i]));
        EXPECT_LE(k.tap[i], k.tap[i - 1] + 1);
        total += 2 * k.tap[i];
        variance += 2 * i * i * k.tap[i] / sum;
      }
      EXPECT_EQ(total, sum);
      if (sigma >= 0.7) {
        EXPECT_NEAR(std::sqrt(variance) / sigma, 1, 0.04) << sigma;
      }
    }
}

TEST(Kernel, ConvolutionsOfIndicatorsAreExact) {
  std::mt19937 random(1);
  for (double sigma : {0.25, 0.5, 1.0, 1.4142135, 2.0, 4.0})
    for (int stride : {1, 16}) {
      const Kernel k = gaussian_kernel(sigma, 256);
      const int n = 37 * stride;
      const int border = k.radius() * stride;
      std::vector<float> in(n + 2 * border);
      for (float& v : in) v = static_cast<float>(random() % 2);
      std::vector<float> out(n);
      convolve(in.data() + border, out.data(), n, stride, k);
      for (int i = 0; i < n; ++i) {
        int expected = 0;
        for (int o = -k.radius(); o <= k.radius(); ++o)
          expected += static_cast<int>(k.tap[std::abs(o)]) * static_cast<int>(in[border + i + o * stride]);
        EXPECT_EQ(out[i], static_cast<float>(expected));
      }
    }
}

}  // namespace
}  // namespace treemarch
