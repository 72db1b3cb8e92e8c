#include <cmath>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/field/block_builder.h"
#include "treemarch/field/field.h"

namespace treemarch {

namespace {

/// Farthest layer of voxels on which a flat interface still has a say.
int band_of(const IndicatorFilter& filter, int sum) {
  const auto tail = [&](const Kernel& k, int from) {
    float t = 0;
    for (int i = from; i <= k.radius(); ++i) t += k.tap[i];
    return t;
  };
  int band = filter.radius();
  while (band > 1 && filter.scale * tail(filter.first, band) - tail(filter.second, band) < sum / 512.0F) --band;
  return band;
}

template <int Dim>
IndicatorFilter make_filter(FieldKind kind, double sigma) {
  IndicatorFilter filter;
  if (kind != FieldKind::gauss && kind != FieldKind::dgf) return filter;
  if (!(sigma >= 0.25 && sigma <= 3))
    throw Error(ErrorKind::usage, "--sigma: " + std::to_string(sigma) + " is out of range; choose 0.25 to 3 voxels");
  constexpr int kSum = Dim == 3 ? 1 << 8 : 1 << 12;  // kSum^Dim is 2^24: sums are exact in single precision
  filter.first = gaussian_kernel(sigma, kSum);
  if (kind == FieldKind::dgf) {
    // G(G) is the Gaussian of the sum of the variances.
    filter.second = gaussian_kernel(sigma * std::sqrt(2.0), kSum);
    filter.scale = 2;
  }
  filter.band = band_of(filter, kSum);
  return filter;
}

template <int Dim>
Field<Dim> build(const LabelImage<Dim>& image, FieldKind kind, const IndicatorFilter& filter, const GreyRule& grey,
                 const FieldOptions&, Execution& execution) {
  Bricks<Dim> bricks;
  bricks.extent = image.extent;
  Coord<Dim> blocks{};
  for (int d = 0; d < Dim; ++d) {
    bricks.brick_extent[d] = (image.extent[d] - 1) / Bricks<Dim>::kSide + 1;
    blocks[d] = (image.extent[d] - 1) / BlockBuilder<Dim>::kSide + 1;
  }
  const std::int64_t block_total = product(blocks);
  if (block_total >= std::int64_t{1} << 31) throw Error(ErrorKind::limits, "image: too many voxels; crop it");
  bricks.refs.resize(static_cast<std::size_t>(product(bricks.brick_extent)));
  bricks.chunks.resize(static_cast<std::size_t>(block_total));
  parallel_for_ranges(execution, block_total, 8, [&](std::int64_t begin, std::int64_t end) {
    BlockBuilder<Dim> builder(image, filter, grey);
    for (std::int64_t b = begin; b < end; ++b)
      builder.build(coord_of(b, blocks), static_cast<std::uint32_t>(b), bricks, nullptr);
  });
  return Field<Dim>(kind, image.frame.spacing, std::move(bricks));
}

}  // namespace

template <int Dim>
Field<Dim> build_field(const LabelImage<Dim>& image, const FieldOptions& options, Execution& execution) {
  if (options.kind == FieldKind::grey)
    throw Error(ErrorKind::usage, "--field grey: needs grey values; give --grey FILE and --threshold T");
  const Execution::Stage stage(execution, "field");
  return build(image, options.kind, make_filter<Dim>(options.kind, options.sigma), GreyRule{}, options, execution);
}

template Field<2> build_field(const LabelImage<2>&, const FieldOptions&, Execution&);
template Field<3> build_field(const LabelImage<3>&, const FieldOptions&, Execution&);

}  // namespace treemarch
