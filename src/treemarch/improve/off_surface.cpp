#include "treemarch/improve/off_surface.h"

#include <algorithm>
#include <array>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 14;

}  // namespace

template <int Dim>
std::vector<VertexId> off_surface_vertices(const Points<Dim>& points, const MaterialsAround& around,
                                           const Field<Dim>& field, float tolerance, const Execution& execution) {
  const std::int64_t n = around.size();
  std::vector<std::vector<VertexId>> part(static_cast<std::size_t>(block_count(n, kBlock)));
  parallel_for(execution, static_cast<std::int64_t>(part.size()), 1, [&](std::int64_t b) {
    for (std::int64_t v = b * kBlock; v < std::min(n, (b + 1) * kBlock); ++v) {
      if (!around.several(static_cast<VertexId>(v))) continue;
      std::array<LabelWeight, 2> best;
      const int found = field.sample(points[v], best);
      if (found == 1 || best[0].weight - best[1].weight > tolerance) part[b].push_back(static_cast<VertexId>(v));
    }
  });
  std::vector<VertexId> all;
  for (const auto& some : part) all.insert(all.end(), some.begin(), some.end());
  return all;
}

template std::vector<VertexId> off_surface_vertices(const Points<2>&, const MaterialsAround&, const Field<2>&, float,
                                                    const Execution&);
template std::vector<VertexId> off_surface_vertices(const Points<3>&, const MaterialsAround&, const Field<3>&, float,
                                                    const Execution&);

}  // namespace treemarch
