#include "treemarch/topology/pinches.h"

#include <algorithm>
#include <array>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/vertex_link.h"

namespace treemarch {
namespace {

/// For every set of the 2^Dim voxels around a corner: whether its boundary is a manifold at the corner.
template <int Dim>
const std::vector<std::uint8_t>& pinched_sets() {
  constexpr int kVoxels = 1 << Dim;
  static const std::vector<std::uint8_t> table = [] {
    // The voxels are octants; the link is that of their cube: corners are voxels, rim vertices 2 d and 2 d + 1 the
    // directions along axis d.
    std::vector<std::uint8_t> pinched(1U << kVoxels);
    constexpr VertexId kCentre = 6;
    VertexLink<Dim> link;
    for (unsigned set = 0; set < pinched.size(); ++set) {
      link.clear();
      for (int v = 0; v < kVoxels; ++v) {
        std::array<VertexId, Dim + 1> simplex{};
        for (int d = 0; d < Dim; ++d) simplex[d] = static_cast<VertexId>(2 * d + (v >> d & 1));
        simplex[Dim] = kCentre;
        link.add(kSimplex<Dim>, simplex.data(), kCentre, set >> v & 1U);
      }
      for (const auto& e : link.excess()) pinched[set] |= static_cast<std::uint8_t>(e.material == 1);
    }
    return pinched;
  }();
  return table;
}

}  // namespace

template <int Dim>
std::vector<ImagePinch> find_image_pinches(const LabelImage<Dim>& image, const Execution& execution) {
  constexpr int kVoxels = 1 << Dim;
  Coord<Dim> corners = image.extent;
  for (auto& c : corners) ++c;
  const std::int64_t row = corners[0], rows = product(corners) / row;
  const std::vector<std::uint8_t>& pinched = pinched_sets<Dim>();
  std::vector<std::vector<ImagePinch>> found(static_cast<std::size_t>(rows));
  image.voxels.visit([&](const auto* voxels) {
    parallel_for(execution, rows, 16, [&](std::int64_t r) {
      for (std::int64_t i = r * row; i < (r + 1) * row; ++i) {
        const Coord<Dim> corner = coord_of(i, corners);
        std::array<MaterialId, kVoxels> around{};
        bool same = true;
        for (int v = 0; v < kVoxels; ++v) {
          std::int64_t at = 0;
          bool inside = true;
          for (int d = Dim; d-- > 0;) {
            const std::int32_t x = corner[d] - 1 + (v >> d & 1);
            inside &= x >= 0 && x < image.extent[d];
            at = at * image.extent[d] + x;
          }
          around[v] = inside ? voxels[at] : kOutside;
          same &= around[v] == around[0];
        }
        if (same) continue;
        std::array<MaterialId, kVoxels> materials = around;
        std::ranges::sort(materials);
        const auto last = std::unique(materials.begin(), materials.end());
        for (auto m = materials.begin(); m != last && *m != kOutside; ++m) {
          unsigned set = 0;
          for (int v = 0; v < kVoxels; ++v) set |= static_cast<unsigned>(around[v] == *m) << v;
          if (pinched[set]) found[static_cast<std::size_t>(r)].push_back({i, *m});
        }
      }
    });
  });
  std::vector<ImagePinch> all;
  for (const auto& in_row : found) all.insert(all.end(), in_row.begin(), in_row.end());
  return all;
}

template std::vector<ImagePinch> find_image_pinches(const LabelImage<2>&, const Execution&);
template std::vector<ImagePinch> find_image_pinches(const LabelImage<3>&, const Execution&);

}  // namespace treemarch
