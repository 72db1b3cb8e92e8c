#include "treemarch/image/uniform_blocks.h"

#include "treemarch/core/parallel.h"

namespace treemarch {

template <int Dim>
UniformBlocks<Dim>::UniformBlocks(const LabelImage<Dim>& image, const Execution& execution) : voxels_(image.extent) {
  extent_ = blocks_around(VoxelBox<Dim>{{}, image.extent}).end;
  material_.assign(static_cast<std::size_t>(product(extent_)), kMixed);
  image.voxels.visit([&](const auto* voxels) { find(image, voxels, execution); });
}

/// Compares the rows of a row of blocks with their first one.
template <int Dim>
template <class T>
void UniformBlocks<Dim>::find(const LabelImage<Dim>& image, const T* voxels, const Execution& execution) {
  const std::int64_t width = voxels_[0], blocks = extent_[0];
  parallel_for_ranges(execution, size() / std::max<std::int64_t>(1, blocks), 4,
                      [&](std::int64_t begin, std::int64_t end) {
                        std::vector<T> differs(static_cast<std::size_t>(width));
                        for (std::int64_t r = begin; r < end; ++r) {
                          VoxelBox<Dim> box = voxels_of_block(coord_of(r * blocks, extent_), voxels_);
                          box.end[0] = voxels_[0];
                          const T* first = voxels + linear_index(box.begin, voxels_);
                          for (std::int64_t i = 0; i < width; ++i)
                            differs[i] = static_cast<T>(first[i] ^ first[i & ~static_cast<std::int64_t>(kSide - 1)]);
                          for_each_row(box, image.extent, [&](const Coord<Dim>&, std::int64_t at) {
                            const T* row = voxels + at;
                            T* const to = differs.data();
                            for (std::int64_t i = 0; i < width; ++i)
                              to[i] = static_cast<T>(to[i] | (row[i] ^ first[i]));
                          });
                          for (std::int64_t b = 0; b < blocks; ++b) {
                            T any = 0;
                            for (std::int64_t i = b * kSide; i < std::min<std::int64_t>(width, (b + 1) * kSide); ++i)
                              any = static_cast<T>(any | differs[i]);
                            if (any == 0) material_[static_cast<std::size_t>(r * blocks + b)] = first[b * kSide];
                          }
                        }
                      });
}

template <int Dim>
MaterialId UniformBlocks<Dim>::within(Coord<Dim> first, Coord<Dim> last) const {
  for (int d = 0; d < Dim; ++d) {
    first[d] = std::max(first[d], 0) >> kShift;
    last[d] = (std::min(last[d], voxels_[d] - 1) >> kShift) + 1;
  }
  const MaterialId material = (*this)[linear_index(first, extent_)];
  bool same = true;
  for_each_row<Dim>({first, last}, extent_, [&](const Coord<Dim>&, std::int64_t at) {
    for (std::int64_t b = at; b < at + last[0] - first[0]; ++b) same &= (*this)[b] == material;
  });
  return same ? material : kMixed;
}

template class UniformBlocks<1>;
template class UniformBlocks<2>;
template class UniformBlocks<3>;
template class UniformBlocks<4>;

}  // namespace treemarch
