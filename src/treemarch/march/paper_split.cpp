#include "treemarch/march/paper_split.h"

#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

namespace treemarch {

namespace {

template <int Dim>
using Signs = std::array<std::int8_t, Dim + 1>;
using Corners = std::vector<std::uint8_t>;

/// What a face of the simplex (a set of its corners) has on one side of the surface, or on the surface (side 0).
struct Part {
  unsigned face;
  int side;
};

template <int Dim>
bool has_sign(const Signs<Dim>& signs, unsigned face, int sign) {
  for (int i = 0; i <= Dim; ++i) {
    if ((face >> i & 1U) != 0 && signs[i] == sign) return true;
  }
  return false;
}

/// Corners and cut points of a part, in the order of the rule.
template <int Dim>
Corners corners_of(const Signs<Dim>& signs, Part part) {
  Corners corners;
  for (int i = 0; i <= Dim; ++i) {
    if ((part.face >> i & 1U) != 0 && (signs[i] == 0 || signs[i] == part.side)) {
      corners.push_back(static_cast<std::uint8_t>(i));
    }
  }
  constexpr auto kEnds = edge_ends<Dim>();
  for (std::size_t e = 0; e < kEnds.size(); ++e) {
    const auto [a, b] = kEnds[e];
    if ((part.face >> a & part.face >> b & 1U) != 0 && signs[a] * signs[b] < 0) {
      corners.push_back(static_cast<std::uint8_t>(Dim + 1 + e));
    }
  }
  return corners;
}

template <int Dim>
int dimension_of(const Signs<Dim>& signs, Part part) {
  const int size = std::popcount(part.face);
  const bool solid = part.side != 0 && has_sign<Dim>(signs, part.face, part.side);
  const bool crossed = has_sign<Dim>(signs, part.face, 1) && has_sign<Dim>(signs, part.face, -1);
  if (solid) return size - 1;
  if (part.side == 0 && crossed) return size - 2;
  return static_cast<int>(corners_of<Dim>(signs, {part.face, 0}).size()) -
         1;  // a face whose corners lie on the surface
}

/// The simplices of a part by the pulling rule, unoriented.
template <int Dim>
std::vector<Corners> pull(const Signs<Dim>& signs, Part part) {
  const Corners corners = corners_of<Dim>(signs, part);
  const int dimension = dimension_of<Dim>(signs, part);
  if (static_cast<int>(corners.size()) == dimension + 1) return {corners};
  std::vector<Part> faces;
  for (int i = 0; i <= Dim; ++i) {
    if ((part.face >> i & 1U) != 0) faces.push_back({part.face & ~(1U << i), part.side});
  }
  if (part.side != 0) faces.push_back({part.face, 0});
  std::vector<Corners> simplices;
  std::vector<Corners> seen;
  for (const Part& face : faces) {
    const Corners of_face = corners_of<Dim>(signs, face);
    if (dimension_of<Dim>(signs, face) != dimension - 1 || std::ranges::count(of_face, corners[0]) != 0) continue;
    if (std::ranges::count(seen, of_face) != 0) continue;
    seen.push_back(of_face);
    for (Corners simplex : pull<Dim>(signs, face)) {
      simplex.insert(simplex.begin(), corners[0]);
      simplices.push_back(std::move(simplex));
    }
  }
  return simplices;
}

/// Sign of the orientation of a piece with all cuts at the middle, in barycentric coordinates: small integers.
template <int Dim>
int orientation(const Corners& piece) {
  constexpr auto kEnds = edge_ends<Dim>();
  std::array<std::array<double, Dim + 1>, Dim + 1> m{};
  for (int r = 0; r <= Dim; ++r) {
    if (piece[r] <= Dim) {
      m[r][piece[r]] = 2;
    } else {
      const auto [a, b] = kEnds[piece[r] - Dim - 1];
      m[r][a] = m[r][b] = 1;
    }
  }
  double determinant = 1;
  for (int c = 0; c <= Dim; ++c) {
    int pivot = c;
    while (pivot < Dim && m[pivot][c] == 0) ++pivot;
    if (pivot != c) {
      std::swap(m[pivot], m[c]);
      determinant = -determinant;
    }
    determinant *= m[c][c];
    for (int r = c + 1; r <= Dim; ++r) {
      const double factor = m[r][c] / m[c][c];
      for (int k = c; k <= Dim; ++k) m[r][k] -= factor * m[c][k];
    }
  }
  return determinant > 0 ? 1 : -1;
}

template <int Dim>
SimplexSplit<Dim> make_split(const Signs<Dim>& signs) {
  constexpr unsigned kAll = (1U << (Dim + 1)) - 1;
  SimplexSplit<Dim> split;
  const auto add = [&](Corners corners, int side) {
    if (orientation<Dim>(corners) < 0) std::swap(corners[Dim - 1], corners[Dim]);
    auto& piece = split.pieces[static_cast<std::size_t>(split.count++)];
    std::ranges::copy(corners, piece.corners.begin());
    piece.side = static_cast<std::int8_t>(side);
  };
  for (const int side : {1, -1}) {
    if (!has_sign<Dim>(signs, kAll, side)) continue;
    for (Corners& corners : pull<Dim>(signs, {kAll, side})) add(std::move(corners), side);
  }
  if (split.count == 0) add(corners_of<Dim>(signs, {kAll, 0}), 0);
  return split;
}

template <int Dim>
SimplexSlice<Dim> make_slice(const Signs<Dim>& signs) {
  constexpr unsigned kAll = (1U << (Dim + 1)) - 1;
  SimplexSlice<Dim> slice;
  if (dimension_of<Dim>(signs, {kAll, 0}) != Dim - 1) return slice;
  // A corner off the surface tells the sides apart.
  const auto off = std::ranges::find_if(signs, [](std::int8_t s) { return s != 0; });
  for (Corners& corners : pull<Dim>(signs, {kAll, 0})) {
    corners.push_back(static_cast<std::uint8_t>(off - signs.begin()));
    if (orientation<Dim>(corners) != *off) std::swap(corners[0], corners[1]);
    std::copy_n(corners.begin(), Dim, slice.pieces[static_cast<std::size_t>(slice.count++)].begin());
  }
  return slice;
}

constexpr std::size_t power_of_three(int n) { return n == 0 ? 1 : 3 * power_of_three(n - 1); }

/// One entry for each pattern of signs.
template <int Dim, class Make>
auto make_table(const Make& make) {
  std::vector<decltype(make(Signs<Dim>{}))> table(power_of_three(Dim + 1));
  for (std::size_t code = 0; code < table.size(); ++code) {
    Signs<Dim> signs{};
    std::size_t rest = code;
    for (std::int8_t& sign : signs) {
      sign = static_cast<std::int8_t>(static_cast<int>(rest % 3) - 1);
      rest /= 3;
    }
    table[code] = make(signs);
  }
  return table;
}

template <int Dim>
std::size_t code_of(const Signs<Dim>& signs) {
  std::size_t code = 0;
  for (int i = Dim; i >= 0; --i) code = code * 3 + static_cast<std::size_t>(signs[i] + 1);
  return code;
}

}  // namespace

template <int Dim>
const SimplexSplit<Dim>& simplex_split(const std::array<std::int8_t, Dim + 1>& signs) {
  static const auto kTable = make_table<Dim>(make_split<Dim>);
  return kTable[code_of<Dim>(signs)];
}

template <int Dim>
const SimplexSlice<Dim>& simplex_slice(const std::array<std::int8_t, Dim + 1>& signs) {
  static const auto kTable = make_table<Dim>(make_slice<Dim>);
  return kTable[code_of<Dim>(signs)];
}

template const SimplexSplit<2>& simplex_split<2>(const std::array<std::int8_t, 3>&);
template const SimplexSplit<3>& simplex_split<3>(const std::array<std::int8_t, 4>&);
template const SimplexSplit<4>& simplex_split<4>(const std::array<std::int8_t, 5>&);
template const SimplexSlice<3>& simplex_slice<3>(const std::array<std::int8_t, 4>&);
template const SimplexSlice<4>& simplex_slice<4>(const std::array<std::int8_t, 5>&);

}  // namespace treemarch
