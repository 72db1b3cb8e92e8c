// The worst angles that docs/stages/tessellate-midpoint.md publishes, searched for in random trees of cubes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/trees.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {
namespace {

struct Row {
  const char* name;
  std::vector<std::string> pattern;
  int balance;
  double density;  ///< 0: a uniform tree
  bool templates;
  double min, max;  ///< degrees, to one decimal
  FacetRule facets = FacetRule::midpoint;
};

template <int Dim>
DegreeRange worst_angles(const Row& row, int side) {
  Execution execution(1);
  MidpointOptions options;
  options.templates = row.templates;
  options.facets = row.facets;
  DegreeRange worst;
  for (unsigned seed = 0; seed < (row.density > 0 ? 40U : 1U); ++seed) {
    const double density = row.density * (1 + seed % 4);
    auto tree = testing::tree_of<Dim>({row.pattern, row.balance, {side}, seed, density}, 1);
    tree.lattice.unit = Frame<Dim>::filled(1.0);
    worst.add(measure_quality(tessellate_midpoint(tree, options, execution), Frame<Dim>{}, 0, execution).angles);
  }
  return worst;
}

template <int Dim>
void check(const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    std::int32_t side = 1;
    for (const std::string& f : row.pattern) side *= f[0] - '0';
    const DegreeRange found = worst_angles<Dim>(row, side * (Dim == 2 ? 4 : 1));
    EXPECT_NEAR(found.min, row.min, 0.05) << row.name;
    EXPECT_NEAR(found.max, row.max, 0.05) << row.name;
  }
}

const std::vector<std::string> kTwos{"2", "2", "2", "2"};
const std::vector<std::string> kThrees{"3", "3", "3"};

TEST(MidpointAngles, AsPublished2D) {
  check<2>({{"uniform, template", kTwos, 1, 0, true, 45, 90},
            {"uniform, midpoint rule", kTwos, 1, 0, false, 45, 90},
            {"2x2, 2:1", kTwos, 1, 0.005, true, 45, 90},
            {"2x2, 4:1", kTwos, 2, 0.002, true, 18.4, 116.6},
            {"2x2, unbalanced 16:1", kTwos, kUnbalanced, 0.001, true, 3.8, 131.2},
            {"3x3, 3:1", kThrees, 1, 0.002, true, 26.6, 108.4},
            {"3x3, unbalanced 27:1", kThrees, kUnbalanced, 0.0005, true, 2.2, 132.8}});
}

TEST(MidpointAngles, AsPublished3D) {
  check<3>({{"uniform, template", kTwos, 1, 0, true, 54.7, 90},
            {"uniform, midpoint rule", kTwos, 1, 0, false, 45, 120},
            {"2x2x2, 2:1", kTwos, 1, 0.0005, true, 45, 120},
            {"2x2x2, 2:1, midpoint rule", kTwos, 1, 0.0005, false, 45, 120},
            {"2x2x2, 4:1", kTwos, 2, 0.0003, true, 18.4, 125.3},
            {"2x2x2, unbalanced 16:1", kTwos, kUnbalanced, 0.0002, true, 8.1, 136.7},
            {"3x3x3, 3:1", kThrees, 1, 0.00005, true, 26.6, 133.3},
            {"3x3x3, unbalanced 27:1", kThrees, kUnbalanced, 0.00005, true, 7.1, 141.5}});
}

TEST(MidpointAngles, OfExtendedTemplatesAsPublished) {
  check<3>({{"2x2x2, 2:1", kTwos, 1, 0.0005, true, 30, 125.3, FacetRule::extended},
            {"2x2x2, 4:1", kTwos, 2, 0.0003, true, 13.9, 149.0, FacetRule::extended},
            {"2x2x2, unbalanced 16:1", kTwos, kUnbalanced, 0.0002, true, 6.6, 149.0, FacetRule::extended},
            {"3x3x3, 3:1", kThrees, 1, 0.00005, true, 15.5, 148.1, FacetRule::extended}});
}

}  // namespace
}  // namespace treemarch
