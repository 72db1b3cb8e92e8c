/// \file
/// The voxel lists of a whole image, for tests of the steps of build_field().
#pragma once

#include "treemarch/field/block_builder.h"

namespace treemarch {

/// The filter of the debiased Gaussian with sigma 1.
template <int Dim>
IndicatorFilter debiased_filter() {
  const int sum = Dim == 3 ? 256 : 4096;
  return {gaussian_kernel(1, sum), gaussian_kernel(std::sqrt(2.0), sum), 2, 2};
}

template <int Dim>
VoxelLists<Dim> lists_of(const LabelImage<Dim>& image, const IndicatorFilter& filter,
                         std::vector<std::uint64_t>& flagged) {
  VoxelLists<Dim> lists;
  lists.extent = image.extent;
  Coord<Dim> blocks{};
  for (int d = 0; d < Dim; ++d) {
    lists.brick_extent[d] = (image.extent[d] - 1) / VoxelLists<Dim>::kSide + 1;
    blocks[d] = (image.extent[d] - 1) / BlockBuilder<Dim>::kSide + 1;
  }
  lists.refs.resize(static_cast<std::size_t>(product(lists.brick_extent)));
  lists.chunks.resize(static_cast<std::size_t>(product(blocks)));
  flagged.assign(lists.refs.size(), 0);
  const GreyRule no_grey;
  const UniformBlocks<Dim> uniform(image, Execution(1));
  BlockBuilder<Dim> builder(image, uniform, filter, no_grey);
  for (std::int64_t b = 0; b < product(blocks); ++b)
    builder.build(coord_of(b, blocks), static_cast<std::uint32_t>(b), lists, flagged.data());
  return lists;
}

}  // namespace treemarch
