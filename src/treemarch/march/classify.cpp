#include "treemarch/march/classify.h"

#include <array>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"

namespace treemarch {

template <int Dim>
VertexLabels classify_vertices(const SimplexLattice<Dim>& lattice, const Field<Dim>& field, Execution& execution) {
  constexpr std::int64_t kBlock = 4096;
  const auto n = static_cast<std::int64_t>(lattice.vertices.size());
  VertexLabels labels(n);
  std::vector<std::vector<std::pair<VertexId, LabelSet>>> tied(block_count(n, kBlock));
  parallel_for(execution, static_cast<std::int64_t>(tied.size()), 1, [&](std::int64_t block) {
    std::array<LabelWeight, 16> found;
    for (std::int64_t i = block * kBlock; i < std::min(n, (block + 1) * kBlock); ++i) {
      const auto v = static_cast<VertexId>(i);
      const int count = field.sample(lattice.point(v), found);
      if (count == 1 || found[1].weight < found[0].weight - kTie) {
        labels.set_single(v, found[0].material);
        continue;
      }
      LabelSet set;
      for (int k = 0; k < count && found[k].weight >= found[0].weight - kTie; ++k) set.insert(found[k].material);
      tied[block].emplace_back(v, set);
    }
  });
  for (const auto& block : tied)
    for (const auto& [v, set] : block) labels.set_many(v, set);
  return labels;
}

template VertexLabels classify_vertices(const SimplexLattice<2>&, const Field<2>&, Execution&);
template VertexLabels classify_vertices(const SimplexLattice<3>&, const Field<3>&, Execution&);

}  // namespace treemarch
