#include "treemarch/march/paper_split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

template <int Dim>
std::vector<std::array<std::int8_t, Dim + 1>> all_signs() {
  std::vector<std::array<std::int8_t, Dim + 1>> all(1);
  for (int i = 0; i <= Dim; ++i) {
    std::vector<std::array<std::int8_t, Dim + 1>> next;
    for (auto signs : all) {
      for (const int s : {-1, 0, 1}) {
        signs[i] = static_cast<std::int8_t>(s);
        next.push_back(signs);
      }
    }
    all = next;
  }
  return all;
}

/// Points of all codes of a simplex, cuts by linear interpolation of f.
template <int Dim>
std::vector<Vec<Dim>> code_points(const std::array<Vec<Dim>, Dim + 1>& x, const std::array<double, Dim + 1>& f) {
  std::vector<Vec<Dim>> points(x.begin(), x.end());
  for (const auto& [a, b] : edge_ends<Dim>()) points.push_back(x[a] + f[a] / (f[a] - f[b]) * (x[b] - x[a]));
  return points;
}

template <int Dim>
class PaperSplit : public ::testing::Test {
 public:
  std::mt19937 random{7};
  std::uniform_real_distribution<double> uniform{0.05, 1.0};

  std::array<Vec<Dim>, Dim + 1> simplex() {
    std::array<Vec<Dim>, Dim + 1> x{};
    do {
      for (auto& p : x)
        for (auto& c : p) c = uniform(random);
    } while (simplex_determinant<Dim>(x.data(), identity().data()) < 0.05);
    return x;
  }
  static std::array<int, Dim + 1> identity() {
    std::array<int, Dim + 1> order;
    for (int i = 0; i <= Dim; ++i) order[i] = i;
    return order;
  }
};

template <int D>
struct Dimension {
  static constexpr int kValue = D;
};

template <class T>
class Splits : public PaperSplit<T::kValue> {};
using Dimensions = ::testing::Types<Dimension<2>, Dimension<3>, Dimension<4>>;
TYPED_TEST_SUITE(Splits, Dimensions);

TYPED_TEST(Splits, PiecesTileTheSimplexEachOnItsSide) {
  constexpr int kDim = TypeParam::kValue;
  for (const auto& signs : all_signs<kDim>()) {
    for (int repeat = 0; repeat < 5; ++repeat) {
      const auto x = this->simplex();
      std::array<double, kDim + 1> f;
      for (int i = 0; i <= kDim; ++i) f[i] = signs[i] * this->uniform(this->random);
      const auto points = code_points<kDim>(x, f);
      const auto& split = simplex_split<kDim>(signs);
      double sum = 0;
      std::map<std::set<int>, int> facets;
      for (const auto& piece : split) {
        const double volume = simplex_determinant<kDim>(points.data(), piece.corners.data());
        EXPECT_GT(volume, 0);
        sum += volume;
        for (const int corner : piece.corners) {
          if (corner <= kDim) {
            EXPECT_GE(signs[corner] * piece.side, 0);
          } else {
            EXPECT_LT(signs[edge_ends<kDim>()[corner - kDim - 1][0]] * signs[edge_ends<kDim>()[corner - kDim - 1][1]],
                      0);
          }
        }
        for (const int left_out : piece.corners) {
          std::set<int> facet(piece.corners.begin(), piece.corners.end());
          facet.erase(left_out);
          ++facets[facet];
        }
      }
      EXPECT_NEAR(sum, simplex_determinant<kDim>(x.data(), this->identity().data()), 1e-14);
      // A facet of two pieces is inside, one of a single piece lies in a face of the simplex: no corner off it.
      for (const auto& [facet, count] : facets) {
        EXPECT_LE(count, 2);
        bool on_face = false;
        for (int away = 0; away <= kDim; ++away) {
          on_face |= std::ranges::all_of(facet, [&](int c) {
            return c <= kDim ? c != away
                             : edge_ends<kDim>()[c - kDim - 1][0] != away && edge_ends<kDim>()[c - kDim - 1][1] != away;
          });
        }
        EXPECT_EQ(count == 1, on_face);
      }
    }
  }
}

// What a neighbour sees of a shared face depends on the signs and the order of the vertices of that face alone: it is
// the split of the face, of one dimension less.
template <int Dim>
void expect_faces_split_by_their_own_vertices() {
  constexpr auto kEnds = edge_ends<Dim>();
  constexpr auto kFaceEnds = edge_ends<Dim - 1>();
  for (const auto& signs : all_signs<Dim>()) {
    for (int away = 0; away <= Dim; ++away) {
      std::array<std::int8_t, Dim> face_signs;
      std::array<int, Dim> corner_of;
      for (int i = 0, to = 0; i <= Dim; ++i) {
        if (i == away) continue;
        face_signs[to] = signs[i];
        corner_of[to++] = i;
      }
      const auto code_of = [&](int face_code) {
        if (face_code < Dim) return corner_of[face_code];
        const auto [a, b] = kFaceEnds[face_code - Dim];
        for (std::size_t e = 0; e < kEnds.size(); ++e) {
          if (kEnds[e][0] == corner_of[a] && kEnds[e][1] == corner_of[b]) return Dim + 1 + static_cast<int>(e);
        }
        return -1;
      };
      std::set<std::set<int>> expected;
      for (const auto& piece : simplex_split<Dim - 1>(face_signs)) {
        std::set<int> simplex;
        for (const int c : piece.corners) simplex.insert(code_of(c));
        expected.insert(simplex);
      }
      std::set<std::set<int>> found;
      for (const auto& piece : simplex_split<Dim>(signs)) {
        std::set<int> simplex;
        for (const int c : piece.corners) {
          const bool in_face = c <= Dim ? c != away : kEnds[c - Dim - 1][0] != away && kEnds[c - Dim - 1][1] != away;
          if (in_face) simplex.insert(c);
        }
        if (simplex.size() == Dim) found.insert(simplex);
      }
      EXPECT_EQ(found, expected);
    }
  }
}

TEST(PaperSplit, FacesAreSplitByTheirOwnVerticesAlone) {
  expect_faces_split_by_their_own_vertices<3>();
  expect_faces_split_by_their_own_vertices<4>();
}

// The section is what the pieces of the two sides share.
template <int Dim>
void expect_slice_between_the_sides() {
  for (const auto& signs : all_signs<Dim>()) {
    if (std::ranges::count(signs, 1) == 0 || std::ranges::count(signs, -1) == 0) continue;
    std::set<std::set<int>> expected;
    for (const auto& piece : simplex_split<Dim>(signs)) {
      std::set<int> on_surface;
      for (const int c : piece.corners)
        if (c > Dim || signs[c] == 0) on_surface.insert(c);
      if (on_surface.size() == Dim) expected.insert(on_surface);
    }
    std::set<std::set<int>> found;
    for (const auto& piece : simplex_slice<Dim>(signs)) found.insert({piece.begin(), piece.end()});
    EXPECT_EQ(found, expected);
    EXPECT_EQ(simplex_slice<Dim>(signs).count, static_cast<int>(found.size()));
  }
}

TEST(PaperSplit, TheSliceIsWhatBothSidesShare) {
  expect_slice_between_the_sides<3>();
  expect_slice_between_the_sides<4>();
}

TEST(PaperSplit, NoPatternHasMorePiecesThanThereIsRoomFor) {
  int most = 0;
  for (const auto& signs : all_signs<4>()) most = std::max(most, simplex_split<4>(signs).count);
  EXPECT_EQ(most, SimplexSplit<4>::kMaxPieces);
}

TEST(PaperSplit, NumberOfPiecesOfThePapersCases) {
  const auto pieces = [](int plus, int zero, int minus) {
    std::array<std::int8_t, 4> signs;
    std::fill_n(signs.begin(), plus, std::int8_t{1});
    std::fill_n(signs.begin() + plus, zero, std::int8_t{0});
    std::fill_n(signs.begin() + plus + zero, minus, std::int8_t{-1});
    return simplex_split<3>(signs).count;
  };
  EXPECT_EQ(pieces(1, 0, 3), 4);
  EXPECT_EQ(pieces(3, 0, 1), 4);
  EXPECT_EQ(pieces(2, 0, 2), 6);
  EXPECT_EQ(pieces(1, 1, 2), 3);
  EXPECT_EQ(pieces(2, 1, 1), 3);
  EXPECT_EQ(pieces(1, 2, 1), 2);
  EXPECT_EQ(pieces(4, 0, 0), 1);
  EXPECT_EQ(pieces(0, 4, 0), 1);
}

}  // namespace
}  // namespace treemarch
