#include "treemarch/tessellate/body_centred.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <span>
#include <utility>

namespace treemarch {
namespace {

/// A tree of up to three levels, refined at random places; 2:1 balanced.
template <int Dim>
Spacetree<Dim> random_tree(const Coord<Dim>& extent, double share, unsigned seed, Execution& execution) {
  Lattice<Dim> lattice;
  lattice.extent = extent;
  lattice.unit.fill(1);
  Coord<Dim> two{};
  two.fill(2);
  RefinementPattern<Dim> pattern;
  pattern.factors.assign(2, two);
  std::mt19937 random(seed);
  std::vector<std::uint8_t> level(static_cast<std::size_t>(product(extent)));
  for (auto& l : level) l = random() % 1000 < 1000 * share ? 1 + random() % 2 : 0;
  return build_spacetree<Dim>(lattice, pattern, level, 1, execution);
}

template <int Dim>
std::vector<typename LeafStar<Dim>::Simplex> all_simplices(const SimplexLattice<Dim>& lattice) {
  std::vector<typename LeafStar<Dim>::Simplex> all;
  std::array<typename LeafStar<Dim>::Simplex, LeafStar<Dim>::kMostSimplices> listed;
  for (std::size_t leaf = 0; leaf < lattice.leaves.size(); ++leaf) {
    const int n = lattice.star(static_cast<LeafId>(leaf)).simplices(listed);
    all.insert(all.end(), listed.begin(), listed.begin() + n);
  }
  return all;
}

template <int Dim>
void expect_sound(const Coord<Dim>& extent, double share, unsigned seed) {
  Execution execution(2);
  const auto lattice = tessellate_body_centred(random_tree<Dim>(extent, share, seed, execution), execution);
  const auto simplices = all_simplices(lattice);
  double volume = 0;
  std::set<VertexId> used;
  std::set<std::pair<VertexId, VertexId>> edges, met;
  for (const auto& s : simplices) {
    const auto e = [&](int k) { return lattice.point(s[k]) - lattice.point(s[0]); };
    double det;
    if constexpr (Dim == 2)
      det = (e(1)[0] * e(2)[1] - e(1)[1] * e(2)[0]) / 2;
    else
      det = dot(cross(e(1), e(2)), e(3)) / 6;
    ASSERT_GT(det, 0);
    volume += det;
    used.insert(s.begin(), s.end());
    for (const VertexId u : s)
      for (const VertexId v : s)
        if (u < v) edges.insert({u, v});
  }
  // Positive simplices that fill the box, and facets that two of them share or that lie on the box: a conforming mesh.
  EXPECT_NEAR(volume, static_cast<double>(product(extent)), 1e-9 * volume);
  EXPECT_EQ(used.size(), lattice.vertices.size());
  std::multiset<std::vector<VertexId>> facets;
  for (const auto& s : simplices)
    for (int out = 0; out <= Dim; ++out) {
      std::vector<VertexId> facet;
      for (int k = 0; k <= Dim; ++k)
        if (k != out) facet.push_back(s[k]);
      std::ranges::sort(facet);
      facets.insert(facet);
    }
  for (const auto& facet : facets) {
    unsigned hull = (1U << Dim) - 1;
    for (const VertexId v : facet) hull &= lattice.hull_axes(v);
    ASSERT_EQ(facets.count(facet), hull ? 1U : 2U);
  }
  for (std::size_t leaf = 0; leaf < lattice.leaves.size(); ++leaf)
    lattice.star(static_cast<LeafId>(leaf)).for_edges([&](VertexId u, VertexId v) {
      met.insert({std::min(u, v), std::max(u, v)});
    });
  EXPECT_EQ(met, edges);
}

TEST(BodyCentred, IsAConformingMeshWhoseEdgesAreAllMet) {
  for (unsigned seed = 0; seed < 6; ++seed)
    for (const double share : {0.0, 0.03, 0.3, 1.0}) {
      expect_sound<3>({8, 8, 8}, share, seed);
      expect_sound<3>({9, 7, 6}, share, seed);
      expect_sound<2>({16, 16}, share, seed);
      expect_sound<2>({13, 18}, share, seed);
    }
}

/// The spacing of a vertex is the side of the smallest leaf that has it as its centre, corner or hull centre.
TEST(BodyCentred, SpacingIsThatOfTheSmallestLeaf) {
  Execution execution(2);
  const auto lattice = tessellate_body_centred(random_tree<3>({12, 10, 9}, 0.02, 3, execution), execution);
  std::vector<int> expected(lattice.vertices.size(), 99);
  for (std::size_t leaf = 0; leaf < lattice.leaves.size(); ++leaf) {
    const auto star = lattice.star(static_cast<LeafId>(leaf));
    const int side = lattice.sides[lattice.leaves[leaf].level], log2 = side == 1 ? 0 : side == 2 ? 1 : 2;
    const auto offer = [&](VertexId v) { expected[v] = std::min(expected[v], log2); };
    offer(star.centre);
    for (const VertexId v : star.corner) offer(v);
    for (int face = 0; face < 6; ++face)
      if (star.across[face] != star.kNone && lattice.hull_axes(star.across[face])) offer(star.across[face]);
  }
  for (std::size_t v = 0; v < expected.size(); ++v) EXPECT_EQ(int{lattice.spacing[v]}, expected[v]);
}

}  // namespace
}  // namespace treemarch
