#include "treemarch/march/stencil.h"

#include <algorithm>

namespace treemarch {

template <int Dim>
void split_triangle(int face, unsigned pattern, std::vector<std::array<std::uint8_t, 3>>& out) {
  using T = StencilTopology<Dim>;
  using Triangle = std::array<std::uint8_t, 3>;
  const auto corner = T::kFace[face];
  const auto cut_between = [&](std::uint8_t a, std::uint8_t b) -> int {
    for (int e = 0; e < T::kEdges; ++e)
      if (T::kEdge[e][0] == std::min(a, b) && T::kEdge[e][1] == std::max(a, b))
        return pattern >> e & 1 ? T::kCut + e : -1;
    return -1;
  };
  // Walk around the rim: corners and cuts.
  std::vector<std::uint8_t> rim;
  std::vector<std::uint8_t> cuts;
  for (int k = 0; k < 3; ++k) {
    rim.push_back(corner[k]);
    const int cut = cut_between(corner[k], corner[(k + 1) % 3]);
    if (cut >= 0) rim.push_back(static_cast<std::uint8_t>(cut)), cuts.push_back(static_cast<std::uint8_t>(cut));
  }
  const auto fan = [&](std::uint8_t from) {
    for (std::size_t k = 0; k < rim.size(); ++k) {
      const std::uint8_t a = rim[k], b = rim[(k + 1) % rim.size()];
      if (a != from && b != from) out.push_back(Triangle{from, a, b});
    }
  };
  if (cuts.size() == 0) {
    out.push_back(Triangle{corner[0], corner[1], corner[2]});
  } else if (cuts.size() == 1) {
    fan(cuts[0]);
  } else if (cuts.size() == 2) {
    std::sort(cuts.begin(), cuts.end());
    fan(cuts[pattern >> (T::kEdges + face) & 1]);
  } else {
    fan(static_cast<std::uint8_t>(T::kTriple + face));
  }
}

namespace {

// A face is seen from inside the simplex with this orientation (3D).
constexpr bool kFaceInward[4] = {true, false, true, false};

template <int Dim>
Stencil<Dim> build(unsigned pattern) {
  using T = StencilTopology<Dim>;
  Stencil<Dim> result;
  if constexpr (Dim == 2) {
    Pieces<2> pieces;
    split_triangle<2>(0, pattern, pieces);
    result.choices.push_back(pieces);
    result.apex.push_back(pieces[0][0]);
  } else {
    std::array<std::vector<std::array<std::uint8_t, 3>>, 4> boundary;
    for (int f = 0; f < 4; ++f) split_triangle<3>(f, pattern, boundary[f]);
    for (std::uint8_t apex = 0; apex < T::kPoints; ++apex) {
      bool used = apex == T::kInner && (pattern & 63), valid = true;
      Pieces<3> pieces;
      for (int f = 0; f < 4; ++f) {
        const auto contains = [&](const auto& t) { return std::find(t.begin(), t.end(), apex) != t.end(); };
        const auto with = std::count_if(boundary[f].begin(), boundary[f].end(), contains);
        used |= with > 0;
        if (with > 0) valid &= with == static_cast<std::ptrdiff_t>(boundary[f].size());
        if (with == 0)
          for (const auto& t : boundary[f])
            pieces.push_back(kFaceInward[f] ? std::array<std::uint8_t, 4>{t[0], t[1], t[2], apex}
                                            : std::array<std::uint8_t, 4>{t[0], t[2], t[1], apex});
      }
      if (!used || !valid) continue;
      result.choices.push_back(pieces);
      result.apex.push_back(apex);
      if (!(pattern & 63)) break;  // an uncut simplex is its own only piece
    }
  }
  return result;
}

}  // namespace

template <int Dim>
const Stencil<Dim>& stencil(unsigned pattern) {
  using T = StencilTopology<Dim>;
  static const std::vector<Stencil<Dim>> table = [] {
    std::vector<Stencil<Dim>> t;
    for (unsigned p = 0; p < 1U << (T::kEdges + T::kFaces); ++p) t.push_back(build<Dim>(p));
    return t;
  }();
  return table[pattern];
}

namespace {

template <int Dim>
std::array<Vec<Dim>, Dim + 1> corners_of(const std::array<std::uint8_t, Dim + 1>& piece,
                                         const std::array<Vec<Dim>, StencilTopology<Dim>::kPoints>& points) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = points[piece[k]];
  return p;
}

}  // namespace

template <int Dim>
StencilChoice best_choice(const Stencil<Dim>& stencil,
                          const std::array<Vec<Dim>, StencilTopology<Dim>::kPoints>& points, bool inner,
                          const QualityBound& enough) {
  constexpr double kBetter = 1e-9;  // degrees: of equal choices the first is taken, whatever rounding makes of them
  StencilChoice best;
  QualityBound to_beat(0);
  for (std::size_t c = 0; c < stencil.choices.size(); ++c) {
    if (!inner && stencil.apex[c] == StencilTopology<Dim>::kInner) continue;
    // Most choices lose, and that can be told without roots.
    const SquaredQualityBound needed(to_beat);
    bool better = true;
    for (const auto& piece : stencil.choices[c]) {
      better = best.choice < 0 || meets(corners_of<Dim>(piece, points), needed);
      if (!better) break;
    }
    if (!better) continue;
    AngleRange range;
    for (const auto& piece : stencil.choices[c]) range.merge(angle_range<Dim>(corners_of<Dim>(piece, points)));
    if (!(range.high < to_beat.high && range.low > to_beat.low)) continue;
    best = {static_cast<int>(c), range};
    if (meets(range, enough)) break;
    to_beat = QualityBound(quality(range) + kBetter);
  }
  return best;
}

template void split_triangle<2>(int, unsigned, std::vector<std::array<std::uint8_t, 3>>&);
template void split_triangle<3>(int, unsigned, std::vector<std::array<std::uint8_t, 3>>&);
template const Stencil<2>& stencil<2>(unsigned);
template const Stencil<3>& stencil<3>(unsigned);
template StencilChoice best_choice<2>(const Stencil<2>&, const std::array<Vec<2>, 7>&, bool, const QualityBound&);
template StencilChoice best_choice<3>(const Stencil<3>&, const std::array<Vec<3>, 15>&, bool, const QualityBound&);

}  // namespace treemarch
