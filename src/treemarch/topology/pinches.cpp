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

/// Looks at the corners of an image.
template <class T, int Dim>
class Corners {
 public:
  Corners(const LabelImage<Dim>& image, const T* voxels)
      : extent_(image.extent), corners_(image.extent), voxels_(voxels), pinched_(pinched_sets<Dim>()) {
    for (auto& c : corners_) ++c;
  }

  /// Pinches at a corner and at those after it along the first axis.
  void look(const Coord<Dim>& first, std::int32_t end, std::vector<ImagePinch>& found) {
    // The rows of voxels beside those corners.
    std::array<const T*, kRows> rows;
    bool inside = true;
    for (int r = 0; r < kRows; ++r) {
      Coord<Dim> c{};
      bool in = true;
      for (int d = 1; d < Dim; ++d) {
        c[d] = first[d] - 1 + (r >> (d - 1) & 1);
        in &= c[d] >= 0 && c[d] < extent_[d];
      }
      rows[r] = in ? voxels_ + linear_index(c, extent_) : nullptr;
      inside &= in;
    }
    for (std::int32_t x = first[0]; x < end; ++x) {
      if (inside && x > 0 && x < extent_[0]) {
        const T one = rows[0][x];
        bool same = true;
        for (const T* row : rows) same &= row[x - 1] == one && row[x] == one;
        if (same) continue;
      }
      std::array<MaterialId, 2 * kRows> around;
      for (int v = 0; v < 2 * kRows; ++v) {
        const std::int32_t at = x - 1 + (v & 1);
        around[v] = rows[v >> 1] && at >= 0 && at < extent_[0] ? rows[v >> 1][at] : kOutside;
      }
      Coord<Dim> corner = first;
      corner[0] = x;
      add(around, linear_index(corner, corners_), found);
    }
  }

 private:
  static constexpr int kRows = 1 << (Dim - 1);

  void add(const std::array<MaterialId, 2 * kRows>& around, std::int64_t corner, std::vector<ImagePinch>& found) const {
    std::array<MaterialId, 2 * kRows> materials = around;
    std::ranges::sort(materials);
    const auto last = std::unique(materials.begin(), materials.end());
    for (auto m = materials.begin(); m != last && *m != kOutside; ++m) {
      unsigned set = 0;
      for (int v = 0; v < 2 * kRows; ++v) set |= static_cast<unsigned>(around[v] == *m) << v;
      if (pinched_[set]) found.push_back({corner, *m});
    }
  }

  const Coord<Dim> extent_;
  Coord<Dim> corners_;
  const T* voxels_;
  const std::vector<std::uint8_t>& pinched_;
};

}  // namespace

template <int Dim>
std::vector<ImagePinch> find_image_pinches(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform,
                                           const Execution& execution) {
  Coord<Dim> corners = image.extent, blocks;
  for (auto& c : corners) ++c;
  for (int d = 0; d < Dim; ++d) blocks[d] = UniformBlocks<Dim>::block_of(image.extent)[d] + 1;
  constexpr std::int64_t kBlocksPerPart = 256;
  std::vector<std::vector<ImagePinch>> found(static_cast<std::size_t>(block_count(product(blocks), kBlocksPerPart)));
  image.voxels.visit([&]<class T>(const T* voxels) {
    parallel_for(execution, std::ssize(found), 1, [&](std::int64_t part) {
      Corners<T, Dim> look(image, voxels);
      for (std::int64_t b = part * kBlocksPerPart; b < std::min(product(blocks), (part + 1) * kBlocksPerPart); ++b) {
        const VoxelBox<Dim> box = voxels_of_block(coord_of(b, blocks), corners);
        Coord<Dim> low = box.begin, high = box.end;
        for (int d = 0; d < Dim; ++d) low[d] = std::max(0, low[d] - 1), --high[d];
        // A box of one material is not pinched, nor are its own corners on the hull.
        if (uniform.within(low, high) != UniformBlocks<Dim>::kMixed) continue;
        for_each_row(box, corners, [&](const Coord<Dim>& first, std::int64_t) {
          look.look(first, box.end[0], found[static_cast<std::size_t>(part)]);
        });
      }
    });
  });
  std::vector<ImagePinch> all;
  for (const auto& in_part : found) all.insert(all.end(), in_part.begin(), in_part.end());
  parallel_sort(execution, all);
  return all;
}

template std::vector<ImagePinch> find_image_pinches(const LabelImage<2>&, const UniformBlocks<2>&, const Execution&);
template std::vector<ImagePinch> find_image_pinches(const LabelImage<3>&, const UniformBlocks<3>&, const Execution&);

}  // namespace treemarch
