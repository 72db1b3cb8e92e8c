#include "treemarch/sizing/assign_materials.h"

#include <cstdint>
#include <functional>

#include "treemarch/core/parallel.h"
#include "treemarch/sizing/lattice_cover.h"

namespace treemarch {
namespace {

/// Number of voxels of each material.
template <int Dim>
std::vector<std::int64_t> voxel_counts(const LabelImage<Dim>& image, const Execution& execution) {
  using Counts = std::vector<std::int64_t>;
  const auto count = [&](std::int64_t begin, std::int64_t end) {
    Counts counts(image.labels.size(), 0);
    image.voxels.visit([&](const auto* voxels) {
      for (std::int64_t i = begin; i < end; ++i) ++counts[voxels[i]];
    });
    return counts;
  };
  const auto add = [](Counts a, const Counts& b) {
    for (std::size_t m = 0; m < a.size(); ++m) a[m] += b[m];
    return a;
  };
  return parallel_reduce(execution, image.voxels.size(), std::int64_t{1} << 20, Counts(image.labels.size(), 0), count,
                         add);
}

/// Measures the parts of a leaf. The volumes are whole numbers, so that their sums are exact in any order.
template <int Dim>
class Majority {
 public:
  Majority(const LabelImage<Dim>& image, const Lattice<Dim>& lattice, const std::vector<double>& weights,
           const std::vector<std::int64_t>& voxel_counts)
      : image_(image), weights_(weights), voxel_counts_(voxel_counts), volume_(image.labels.size(), 0) {
    for (int d = 0; d < Dim; ++d) covers_.emplace_back(image.extent[d], lattice.extent[d]);
  }

  MaterialId operator()(const Coord<Dim>& corner, const Coord<Dim>& extent) {
    add<Dim - 1>(corner, extent, 0, 1);
    MaterialId best = found_[0];
    for (const MaterialId m : found_)
      if (better(m, best)) best = m;
    for (const MaterialId m : found_) volume_[m] = 0;
    found_.clear();
    return best;
  }

 private:
  template <int Axis>
  void add(const Coord<Dim>& corner, const Coord<Dim>& extent, std::int64_t index, std::int64_t volume) {
    const AxisCover& cover = covers_[Axis];
    const std::int32_t begin = corner[Axis];
    const std::int32_t end = begin + extent[Axis];
    for (std::int32_t v = cover.first_voxel(begin); v <= cover.last_voxel(end); ++v) {
      const std::int64_t i = index * image_.extent[Axis] + v;
      const std::int64_t part = volume * cover.overlap(begin, end, v);
      if constexpr (Axis > 0) {
        add<Axis - 1>(corner, extent, i, part);
      } else {
        const MaterialId m = image_.voxels[i];
        if (volume_[m] == 0) found_.push_back(m);
        volume_[m] += part;
      }
    }
  }

  [[nodiscard]] bool better(MaterialId a, MaterialId b) const {
    const auto weight = [&](MaterialId m) {
      return (m < weights_.size() ? weights_[m] : 1.0) * static_cast<double>(volume_[m]);
    };
    if (weight(a) != weight(b)) return weight(a) > weight(b);
    if (voxel_counts_[a] != voxel_counts_[b]) return voxel_counts_[a] < voxel_counts_[b];
    return a < b;
  }

  const LabelImage<Dim>& image_;
  const std::vector<double>& weights_;
  const std::vector<std::int64_t>& voxel_counts_;
  std::vector<AxisCover> covers_;
  std::vector<std::int64_t> volume_;
  std::vector<MaterialId> found_;
};

}  // namespace

template <int Dim>
void assign_materials(Spacetree<Dim>& tree, const LabelImage<Dim>& image, const std::vector<double>& weights,
                      const Execution& execution) {
  const std::vector<std::int64_t> counts = voxel_counts(image, execution);
  parallel_for_ranges(execution, static_cast<std::int64_t>(tree.leaves.size()), 4096,
                      [&](std::int64_t begin, std::int64_t end) {
                        Majority<Dim> majority(image, tree.lattice, weights, counts);
                        for (std::int64_t i = begin; i < end; ++i) {
                          Leaf<Dim>& leaf = tree.leaves[i];
                          leaf.material = majority(leaf.corner, tree.extent_of(leaf));
                        }
                      });
}

#define TREEMARCH_INSTANTIATE(DIM) \
  template void assign_materials(Spacetree<DIM>&, const LabelImage<DIM>&, const std::vector<double>&, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
