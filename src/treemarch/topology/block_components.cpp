#include "treemarch/topology/block_components.h"

#include <algorithm>

#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {

template <int Dim>
BlockComponents<Dim>::BlockComponents(const LabelImage<Dim>& image, const ComponentMap& map,
                                      std::span<const std::uint8_t> wanted, const Execution& execution)
    : extent_(blocks_around(VoxelBox<Dim>{{}, image.extent}).end) {
  constexpr int kShift = UniformBlocks<Dim>::kShift;
  const std::int64_t blocks = product(extent_), width = extent_[0];
  first_.assign(static_cast<std::size_t>(blocks) + 1, 0);
  std::vector<std::vector<std::uint32_t>> found(static_cast<std::size_t>(blocks / width));  // by rows of blocks
  parallel_for(execution, std::ssize(found), 4, [&](std::int64_t row) {
    VoxelBox<Dim> box = voxels_of_block(coord_of(row * width, extent_), image.extent);
    box.end[0] = image.extent[0];
    std::vector<std::vector<std::uint32_t>> in_block(static_cast<std::size_t>(width));
    for_each_row(box, image.extent, [&](const Coord<Dim>&, std::int64_t at) {
      map.for_runs(static_cast<std::size_t>(at / map.width),
                   [&](std::int64_t begin, std::int64_t end, std::uint32_t component) {
                     if (wanted[component] == 0) return;
                     for (std::int64_t b = begin >> kShift; b <= (end - 1) >> kShift; ++b)
                       if (auto& list = in_block[static_cast<std::size_t>(b)]; list.empty() || list.back() != component)
                         list.push_back(component);
                   });
    });
    auto& all = found[static_cast<std::size_t>(row)];
    for (std::int64_t b = 0; b < width; ++b) {
      auto& list = in_block[static_cast<std::size_t>(b)];
      std::ranges::sort(list);
      list.erase(std::unique(list.begin(), list.end()), list.end());
      first_[static_cast<std::size_t>(row * width + b)] = list.size();
      all.insert(all.end(), list.begin(), list.end());
    }
  });
  exclusive_scan(std::span(first_));
  components_ = joined(execution, found);
}

template class BlockComponents<2>;
template class BlockComponents<3>;

}  // namespace treemarch
