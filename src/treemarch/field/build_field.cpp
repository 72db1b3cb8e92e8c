#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/field/block_builder.h"
#include "treemarch/field/field.h"
#include "treemarch/field/thin.h"

namespace treemarch {

namespace {

/// Of the Gaussian that takes the bias away, in units of the first one's. Two, that is G(G), leaves an inward bias of
/// 0.6 / r voxels on a ball of radius r; three leaves a third of it and costs no smoothness (docs/stages/field.md).
constexpr double kSecondVariance = 3;

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
    filter.second = gaussian_kernel(sigma * std::sqrt(kSecondVariance), kSum);
    filter.scale = 2;
  }
  filter.band = band_of(filter, kSum);
  return filter;
}

/// Scales grey values by the contrast of foreground and background.
template <int Dim>
GreyRule grey_rule(const LabelImage<Dim>& image, const GreyImage<Dim>& grey, double threshold, std::int32_t background,
                   const Execution& execution) {
  GreyRule rule;
  const auto found = std::find(image.labels.begin(), image.labels.end(), background);
  if (found == image.labels.end()) return rule;  // without a background there is nothing for the grey value to decide
  rule.values = grey.values.data();
  rule.background = static_cast<MaterialId>(found - image.labels.begin());
  rule.threshold = threshold;
  using Sums = std::array<double, 4>;  // voxels and sum of values, of the background and of the foreground
  const auto sums = parallel_reduce(
      execution, product(image.extent), 1 << 16, Sums{},
      [&](std::int64_t begin, std::int64_t end) {
        Sums s{};
        for (std::int64_t i = begin; i < end; ++i) {
          if (!std::isfinite(grey.values[i])) continue;
          const int side = image.voxels[i] == rule.background ? 0 : 2;
          s[side] += 1;
          s[side + 1] += grey.values[i];
        }
        return s;
      },
      [](Sums a, const Sums& b) {
        for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
        return a;
      });
  if (sums[0] == 0 || sums[2] == 0) return {};
  const double below = sums[1] / sums[0];
  const double above = sums[3] / sums[2];
  const double contrast = std::max(std::abs(below - threshold), std::abs(above - threshold));
  if (contrast > 0) rule.slope = (above >= below ? 0.5 : -0.5) / contrast;
  return rule;
}

template <int Dim>
Field<Dim> build(const LabelImage<Dim>& image, FieldKind kind, const IndicatorFilter& filter, const GreyRule& grey,
                 bool thin, const std::vector<float>& scale, Execution& execution) {
  VoxelLists<Dim> lists;
  lists.extent = image.extent;
  Coord<Dim> blocks{};
  for (int d = 0; d < Dim; ++d) {
    lists.brick_extent[d] = (image.extent[d] - 1) / VoxelLists<Dim>::kSide + 1;
    blocks[d] = (image.extent[d] - 1) / BlockBuilder<Dim>::kSide + 1;
  }
  const std::int64_t block_total = product(blocks);
  if (block_total >= std::int64_t{1} << 31) throw Error(ErrorKind::limits, "image: too many voxels; crop it");
  lists.refs.resize(static_cast<std::size_t>(product(lists.brick_extent)));
  lists.chunks.resize(static_cast<std::size_t>(block_total));
  const UniformBlocks<Dim> uniform(image, execution);
  std::vector<std::uint64_t> flagged(thin ? lists.refs.size() : 0);
  parallel_for_ranges(execution, block_total, 8, [&](std::int64_t begin, std::int64_t end) {
    BlockBuilder<Dim> builder(image, uniform, filter, grey);
    for (std::int64_t b = begin; b < end; ++b)
      builder.build(coord_of(b, blocks), static_cast<std::uint32_t>(b), lists, thin ? flagged.data() : nullptr);
  });
  if (thin) keep_thin(image, flagged, lists, execution);
  if (!scale.empty())
    parallel_for(execution, std::ssize(lists.refs), 256, [&](std::int64_t b) { lists.rescale(lists.refs[b], scale); });
  return Field<Dim>(kind, image.frame.spacing, make_bricks(lists, execution));
}

}  // namespace

template <int Dim>
Field<Dim> build_field(const LabelImage<Dim>& image, const FieldOptions& options, Execution& execution) {
  if (options.kind == FieldKind::grey)
    throw Error(ErrorKind::usage, "--field grey: needs grey values; give --grey FILE and --threshold T");
  const Execution::Stage stage(execution, "field");
  const IndicatorFilter filter = make_filter<Dim>(options.kind, options.sigma);
  return build(image, options.kind, filter, GreyRule{}, options.keep_thin && !filter.none(), options.scale, execution);
}

template <int Dim>
Field<Dim> build_grey_field(const LabelImage<Dim>& image, const GreyImage<Dim>& grey, double threshold,
                            const FieldOptions& options, Execution& execution) {
  if (grey.extent != image.extent)
    throw Error(ErrorKind::input, "--grey: its extent differs from that of the labels; resample it");
  const Execution::Stage stage(execution, "field");
  const IndicatorFilter filter = make_filter<Dim>(FieldKind::dgf, options.sigma);
  const GreyRule rule = grey_rule(image, grey, threshold, options.background, execution);
  return build(image, FieldKind::grey, filter, rule, options.keep_thin, {}, execution);
}

template Field<2> build_field(const LabelImage<2>&, const FieldOptions&, Execution&);
template Field<3> build_field(const LabelImage<3>&, const FieldOptions&, Execution&);
template Field<2> build_grey_field(const LabelImage<2>&, const GreyImage<2>&, double, const FieldOptions&, Execution&);
template Field<3> build_grey_field(const LabelImage<3>&, const GreyImage<3>&, double, const FieldOptions&, Execution&);

}  // namespace treemarch
