#include "treemarch/tessellate/rim_triangles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace treemarch {
namespace {

/// A square of side 4 with vertices inside its sides where the bits say so, three a side.
std::vector<Vec<2>> rim_of(unsigned bits) {
  std::vector<Vec<2>> rim;
  const Vec<2> corners[] = {{0, 0}, {4, 0}, {4, 4}, {0, 4}};
  for (int side = 0; side < 4; ++side) {
    rim.push_back(corners[side]);
    for (int k = 1; k < 4; ++k)
      if ((bits >> (3 * side + k - 1) & 1U) != 0)
        rim.push_back(corners[side] + 0.25 * k * (corners[(side + 1) % 4] - corners[side]));
  }
  return rim;
}

double area(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  const Vec<2> u = b - a, v = c - a;
  return 0.5 * (u[0] * v[1] - u[1] * v[0]);
}

double smallest_angle(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  const auto at = [](const Vec<2>& p, const Vec<2>& q, const Vec<2>& r) {
    return std::acos(dot(q - p, r - p) / (norm(q - p) * norm(r - p)));
  };
  return std::min({at(a, b, c), at(b, c, a), at(c, a, b)});
}

/// The best of all triangulations, tried one by one.
double best_of_all(const std::vector<Vec<2>>& rim, std::size_t i, std::size_t j) {
  double best = j - i < 2 ? 4 : 0;
  for (std::size_t k = i + 1; k < j; ++k) {
    if (area(rim[i], rim[k], rim[j]) <= 0) continue;
    best = std::max(best,
                    std::min({smallest_angle(rim[i], rim[k], rim[j]), best_of_all(rim, i, k), best_of_all(rim, k, j)}));
  }
  return best;
}

TEST(RimTriangles, FillTheSquareAndNoneIsBetter) {
  for (unsigned bits = 1; bits < 4096; bits += bits % 7 == 0 ? 5 : 3) {
    const auto rim = rim_of(bits);
    const RimTriangles found = triangulate_rim(rim);
    ASSERT_EQ(found.triangles.size(), rim.size() - 2);
    double sum = 0, smallest = 4;
    for (const auto& [a, b, c] : found.triangles) {
      ASSERT_GT(area(rim[a], rim[b], rim[c]), 0);
      sum += area(rim[a], rim[b], rim[c]);
      smallest = std::min(smallest, smallest_angle(rim[a], rim[b], rim[c]));
    }
    EXPECT_NEAR(sum, 16, 1e-12);
    EXPECT_NEAR(std::acos(found.largest_cosine), smallest, 1e-9);
    if (rim.size() < 11) {
      EXPECT_NEAR(smallest, best_of_all(rim, 0, rim.size() - 1), 1e-9) << bits;
    }
  }
}

TEST(RimTriangles, HangingNodesOnAllSidesKeepTheAnglesOfASquare) {
  EXPECT_NEAR(triangulate_rim(rim_of(0b010010010010)).largest_cosine, std::sqrt(0.5), 1e-12);
}

}  // namespace
}  // namespace treemarch
