#include "treemarch/pipeline/prepare.h"

#include <algorithm>
#include <numeric>

#include "treemarch/core/error.h"
#include "treemarch/pipeline/label_table.h"

namespace treemarch {
namespace {

/// New label and name of each material of the image.
struct Relabelling {
  std::vector<std::int32_t> labels;
  std::vector<std::string> names;
};

void merge(const std::string& text, const LabelTable& table, Relabelling& to) {
  const auto [set, target] = split_assignment(text, "--merge");
  const std::vector<MaterialId> from = table.find_set(set, "--merge");
  std::int32_t label = to.labels[from.front()];
  std::string name;
  if (const MaterialId m = table.find_or_none(target); m != kOutside) {
    label = to.labels[m];
    if (!to.names.empty()) name = to.names[m];
  } else if (!parse_int32(target, label)) {
    for (const MaterialId f : from) label = std::min(label, to.labels[f]);
    name = target;
    to.names.resize(to.labels.size());
  }
  for (const MaterialId f : from) {
    to.labels[f] = label;
    if (!to.names.empty()) to.names[f] = name;
  }
}

Relabelling relabelling(const std::vector<std::int32_t>& labels, const std::vector<std::string>& names,
                        const PrepareOptions& options) {
  Relabelling to{labels, names};
  const LabelTable original(labels, names);
  for (const std::string& text : options.merge) merge(text, original, to);
  const LabelTable merged(to.labels, to.names);

  std::vector<char> dropped(labels.size(), !options.keep.empty());
  // A set names labels, and several materials may share one after a merge.
  const auto mark = [&](const std::string& set, const char* option, char value) {
    for (const MaterialId named : merged.find_set(set, option))
      for (std::size_t m = 0; m < labels.size(); ++m)
        if (to.labels[m] == to.labels[named]) dropped[m] = value;
  };
  for (const std::string& set : options.keep) mark(set, "--keep", 0);
  for (const std::string& set : options.drop) mark(set, "--drop", 1);
  for (std::size_t m = 0; m < labels.size(); ++m) {
    if (!dropped[m]) continue;
    to.labels[m] = options.background;
    if (!to.names.empty()) to.names[m].clear();
  }
  return to;
}

template <int Dim>
struct Region {
  Coord<Dim> begin{}, extent{};
};

template <int Dim>
Region<Dim> parse_roi(const std::string& text, const Coord<Dim>& extent) {
  if (text.empty()) return {{}, extent};
  const auto refuse = [&](const std::string& why) { throw Error(ErrorKind::usage, "--roi: '" + text + "' " + why); };
  const auto axes = split(text, ',');
  if (axes.size() != Dim) refuse("must give BEGIN:END for each of the " + std::to_string(Dim) + " axes");
  Region<Dim> region;
  for (int d = 0; d < Dim; ++d) {
    const auto ends = split(axes[static_cast<std::size_t>(d)], ':');
    std::int32_t begin = 0, end = 0;
    if (ends.size() != 2 || !parse_int32(ends[0], begin) || !parse_int32(ends[1], end))
      refuse("must give BEGIN:END for each of the " + std::to_string(Dim) + " axes");
    if (begin < 0 || begin >= end || end > extent[d])
      refuse("is not inside the image, which has " + std::to_string(extent[d]) + " voxels on axis " +
             std::to_string(d));
    region.begin[d] = begin;
    region.extent[d] = end - begin;
  }
  return region;
}

/// Where a part of an image lies.
template <int Dim>
Frame<Dim> frame_of(const Region<Dim>& region, Frame<Dim> frame) {
  Vec<Dim> centre{};  // of its first voxel
  for (int d = 0; d < Dim; ++d) centre[d] = (region.begin[d] + 0.5) * frame.spacing[d];
  frame.origin = to_world(frame, centre);
  return frame;
}

/// Calls f(position in the region, position in the image) for all voxels of a region.
template <int Dim, class F>
void for_each_voxel(const Region<Dim>& region, const Coord<Dim>& extent, F&& f) {
  for (std::int64_t i = 0; i < product(region.extent); ++i) {
    Coord<Dim> voxel = coord_of(i, region.extent);
    for (int d = 0; d < Dim; ++d) voxel[d] += region.begin[d];
    f(i, linear_index(voxel, extent));
  }
}

/// Cuts out the region and numbers the materials by first appearance.
template <int Dim>
LabelImage<Dim> rebuild(const LabelImage<Dim>& image, const Relabelling& to, const Region<Dim>& region) {
  // Materials that share a label are one: represented by the first of them.
  std::vector<MaterialId> by_label(to.labels.size()), same(to.labels.size());
  std::iota(by_label.begin(), by_label.end(), 0U);
  std::ranges::stable_sort(by_label, {}, [&](MaterialId m) { return to.labels[m]; });
  for (std::size_t i = 0; i < by_label.size(); ++i) {
    const bool first = i == 0 || to.labels[by_label[i]] != to.labels[by_label[i - 1]];
    same[by_label[i]] = first ? by_label[i] : same[by_label[i - 1]];
  }

  LabelImage<Dim> result;
  result.extent = region.extent;
  result.frame = frame_of(region, image.frame);
  result.voxels = CompactArray(product(region.extent), image.labels.size());
  std::vector<MaterialId> renumbered(to.labels.size(), kOutside);
  for_each_voxel(region, image.extent, [&](std::int64_t i, std::int64_t from) {
    const MaterialId m = same[image.voxels[from]];
    if (renumbered[m] == kOutside) {
      renumbered[m] = static_cast<MaterialId>(result.labels.size());
      result.labels.push_back(to.labels[m]);
      if (!to.names.empty()) result.names.push_back(to.names[m]);
    }
    result.voxels.set(i, renumbered[m]);
  });
  return result;
}

}  // namespace

template <int Dim>
LabelImage<Dim> prepare_image(LabelImage<Dim> image, const PrepareOptions& options, Execution& execution) {
  const Execution::Stage stage(execution, "prepare");
  const bool selects = !options.keep.empty() || !options.drop.empty() || !options.merge.empty();
  if (selects || !options.roi.empty()) {
    const Relabelling to = relabelling(image.labels, image.names, options);
    image = rebuild(image, to, parse_roi(options.roi, image.extent));
  }
  if (image.labels.size() == 1 && image.labels[0] == options.background) {
    throw Error(ErrorKind::input, "image: all voxels " + std::string(selects ? "that are kept " : "") +
                                      "are background (label " + std::to_string(options.background) +
                                      "); there is nothing to mesh");
  }
  return image;
}

template <int Dim>
GreyImage<Dim> crop_image(GreyImage<Dim> image, const std::string& roi) {
  if (roi.empty()) return image;
  const Region<Dim> region = parse_roi(roi, image.extent);
  GreyImage<Dim> result{region.extent, frame_of(region, image.frame), {}};
  result.values.resize(static_cast<std::size_t>(product(region.extent)));
  for_each_voxel(region, image.extent, [&](std::int64_t i, std::int64_t from) {
    result.values[static_cast<std::size_t>(i)] = image.values[static_cast<std::size_t>(from)];
  });
  return result;
}

template GreyImage<2> crop_image(GreyImage<2>, const std::string&);
template GreyImage<3> crop_image(GreyImage<3>, const std::string&);
template LabelImage<2> prepare_image(LabelImage<2>, const PrepareOptions&, Execution&);
template LabelImage<3> prepare_image(LabelImage<3>, const PrepareOptions&, Execution&);
template LabelImage<4> prepare_image(LabelImage<4>, const PrepareOptions&, Execution&);

}  // namespace treemarch
