/// \file
/// One-dimensional smoothing kernels with integer taps, and their separable application to small blocks.
#pragma once

#include <cstddef>
#include <vector>

namespace treemarch {

/// Symmetric taps: tap[0] is the centre, tap[k] belongs to the offsets k and -k. The taps are whole numbers, and
/// indicators are 0 or 1, so that every sum below 2^24 is exact in single precision: results depend neither on the
/// order of summation nor on the vector width, mirror exactly, and add up to the same over all labels.
struct Kernel {
  std::vector<float> tap;

  [[nodiscard]] int radius() const { return static_cast<int>(tap.size()) - 1; }
};

/// A Gaussian cut at 3 sigma, rounded to whole taps of the given sum, without trailing zeros.
Kernel gaussian_kernel(double sigma, int sum);

/// out[i] = sum over k of tap[|k|] * in[i + k * stride], for 0 <= i < n.
/// \pre in is readable from -radius * stride to n - 1 + radius * stride; out does not overlap it.
void convolve(const float* in, float* out, int n, std::ptrdiff_t stride, const Kernel& kernel);

}  // namespace treemarch
