#include "treemarch/tessellate/rim_triangles.h"

#include <algorithm>
#include <cmath>

namespace treemarch {
namespace {

/// Cosine of the smallest angle of a triangle; 2 if it is flat.
double largest_cosine(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  const Vec<2> u = b - a, v = c - a, w = c - b;
  const double area = u[0] * v[1] - u[1] * v[0];
  const double uu = squared_norm(u), vv = squared_norm(v), ww = squared_norm(w);
  if (std::abs(area) <= 1e-12 * std::max({uu, vv, ww})) return 2;
  return std::max({dot(u, v) / std::sqrt(uu * vv), -dot(u, w) / std::sqrt(uu * ww), dot(v, w) / std::sqrt(vv * ww)});
}

}  // namespace

RimTriangles triangulate_rim(std::span<const Vec<2>> rim) {
  constexpr double kEqual = 1e-12;  // angles that rounding tells apart count as equal
  const std::size_t n = rim.size();
  struct Best {
    double cosine = -1;  // an edge of the rim has no triangle
    std::uint16_t middle = 0;
  };
  std::vector<Best> best(n * n);  // of the part of the polygon from vertex i to vertex j > i
  for (std::size_t length = 2; length < n; ++length) {
    for (std::size_t i = 0; i + length < n; ++i) {
      const std::size_t j = i + length;
      Best& here = best[i * n + j];
      here.cosine = 3;
      for (std::size_t k = i + 1; k < j; ++k) {
        const double cosine =
            std::max({best[i * n + k].cosine, best[k * n + j].cosine, largest_cosine(rim[i], rim[k], rim[j])});
        if (cosine < here.cosine - kEqual) here = {cosine, static_cast<std::uint16_t>(k)};
      }
    }
  }
  RimTriangles result;
  result.largest_cosine = best[n - 1].cosine;
  std::vector<std::array<std::size_t, 2>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i < 2) continue;
    const std::size_t k = best[i * n + j].middle;
    result.triangles.push_back(
        {static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(k), static_cast<std::uint16_t>(j)});
    open.push_back({i, k});
    open.push_back({k, j});
  }
  return result;
}

}  // namespace treemarch
