#include "treemarch/field/kernel.h"

#include <algorithm>
#include <cmath>

#include "treemarch/core/vector_clones.h"

namespace treemarch {

namespace {

template <int Radius>
[[gnu::always_inline]] inline void convolve_fixed(const float* __restrict in, float* __restrict out, int n,
                                                  std::ptrdiff_t stride, const float* tap) {
  for (int i = 0; i < n; ++i) {
    float sum = tap[0] * in[i];
    for (int k = 1; k <= Radius; ++k) sum += tap[k] * (in[i - k * stride] + in[i + k * stride]);
    out[i] = sum;
  }
}

[[gnu::always_inline]] inline void convolve_any(const float* __restrict in, float* __restrict out, int n,
                                                std::ptrdiff_t stride, const float* tap, int radius) {
  for (int i = 0; i < n; ++i) out[i] = tap[0] * in[i];
  for (int k = 1; k <= radius; ++k)
    for (int i = 0; i < n; ++i) out[i] += tap[k] * (in[i - k * stride] + in[i + k * stride]);
}

TREEMARCH_VECTOR_CLONES
void convolve_taps(const float* in, float* out, int n, std::ptrdiff_t stride, const float* tap, int radius) {
  switch (radius) {
    case 3:
      return convolve_fixed<3>(in, out, n, stride, tap);
    case 4:
      return convolve_fixed<4>(in, out, n, stride, tap);
    case 5:
      return convolve_fixed<5>(in, out, n, stride, tap);
    case 6:
      return convolve_fixed<6>(in, out, n, stride, tap);
    default:
      return convolve_any(in, out, n, stride, tap, radius);
  }
}

}  // namespace

Kernel gaussian_kernel(double sigma, int sum) {
  const int radius = std::max(1, static_cast<int>(std::lround(3 * sigma)));
  std::vector<double> exact(static_cast<std::size_t>(radius) + 1);
  double total = 0;
  for (int k = 0; k <= radius; ++k) {
    exact[k] = std::exp(-0.5 * k * k / (sigma * sigma));
    total += k == 0 ? exact[k] : 2 * exact[k];
  }
  // Rounding the sums of the tails, not the taps, keeps all of them within half a unit, so that the centre, which takes
  // the rest, is within one.
  Kernel kernel;
  kernel.tap.assign(exact.size(), 0.0F);
  double tail = 0;
  double rounded = 0;
  for (int k = radius; k >= 1; --k) {
    tail += sum * exact[k] / total;
    kernel.tap[k] = static_cast<float>(std::round(tail) - rounded);
    rounded = std::round(tail);
  }
  kernel.tap[0] = static_cast<float>(sum - 2 * rounded);
  while (kernel.tap.size() > 1 && kernel.tap.back() == 0) kernel.tap.pop_back();
  return kernel;
}

void convolve(const float* in, float* out, int n, std::ptrdiff_t stride, const Kernel& kernel) {
  convolve_taps(in, out, n, stride, kernel.tap.data(), kernel.radius());
}

}  // namespace treemarch
