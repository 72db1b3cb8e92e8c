#include "treemarch/pipeline/clean_up.h"

#include <algorithm>
#include <utility>

#include "treemarch/topology/image_components.h"

namespace treemarch {
namespace {

template <int Dim>
bool on_side(const Coord<Dim>& voxel, const Coord<Dim>& extent) {
  for (int d = 0; d < Dim; ++d)
    if (voxel[d] == 0 || voxel[d] == extent[d] - 1) return true;
  return false;
}

/// Components of at most one label kept: 1 where a component is an island.
std::vector<std::uint8_t> find_islands(const std::vector<ImageComponent>& components, std::size_t materials,
                                       MaterialId background, std::int64_t least) {
  const std::vector<std::int64_t> largest = largest_components(components, materials);
  std::vector<std::uint8_t> island(components.size());
  for (std::size_t c = 0; c < components.size(); ++c)
    island[c] = components[c].material != background && components[c].voxels < least &&
                largest[components[c].material] != static_cast<std::int64_t>(c);
  return island;
}

template <int Dim>
std::vector<std::uint8_t> find_holes(const LabelImage<Dim>& image, const ComponentMap& map, MaterialId background,
                                     std::int64_t most) {
  std::vector<std::uint8_t> hole(map.components.size());
  for (std::size_t c = 0; c < hole.size(); ++c)
    hole[c] = map.components[c].material == background && map.components[c].voxels < most;
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    std::uint8_t& h = hole[map.of(v)];
    if (h != 0 && on_side(coord_of(v, image.extent), image.extent)) h = 0;
  }
  return hole;
}

/// A face between a voxel of a component that goes and one of a component that stays, as the material there.
struct Face {
  std::uint32_t component;
  MaterialId material;
  auto operator<=>(const Face&) const = default;
};

template <int Dim>
std::vector<Face> faces_around(const LabelImage<Dim>& image, const ComponentMap& map,
                               const std::vector<std::uint8_t>& goes, const std::vector<MaterialId>& material) {
  std::vector<Face> faces;
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    const std::uint32_t own = map.of(v);
    if (goes[own] == 0) continue;
    const Coord<Dim> c = coord_of(v, image.extent);
    std::int64_t stride = 1;
    for (int d = 0; d < Dim; ++d) {
      for (const int step : {-1, 1}) {
        if (c[d] + step < 0 || c[d] + step >= image.extent[d]) continue;
        const std::uint32_t other = map.of(v + step * stride);
        if (other != own && goes[other] == 0) faces.push_back({own, material[other]});
      }
      stride *= image.extent[d];
    }
  }
  std::ranges::sort(faces);
  return faces;
}

/// Gives the components away; returns those that found a taker.
template <int Dim>
std::vector<std::uint8_t> absorb(LabelImage<Dim>& image, const ComponentMap& map, std::vector<std::uint8_t> goes) {
  std::vector<MaterialId> material(map.components.size());
  for (std::size_t c = 0; c < material.size(); ++c) material[c] = map.components[c].material;
  std::vector<std::uint8_t> gone(goes.size());
  for (bool any = true; any;) {
    any = false;
    const std::vector<Face> faces = faces_around(image, map, goes, material);
    for (std::size_t i = 0; i < faces.size();) {
      const std::uint32_t component = faces[i].component;
      std::size_t most = 0;
      while (i < faces.size() && faces[i].component == component) {
        const std::size_t first = i;
        while (i < faces.size() && faces[i] == faces[first]) ++i;
        if (i - first > most) most = i - first, material[component] = faces[first].material;
      }
      goes[component] = 0;
      gone[component] = 1;
      any = true;
    }
  }
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    const std::uint32_t c = map.of(v);
    if (gone[c] != 0) image.voxels.set(v, material[c]);
  }
  return gone;
}

/// Materials by first appearance again.
template <int Dim>
void renumber(LabelImage<Dim>& image) {
  std::vector<MaterialId> number(image.labels.size(), kOutside);
  std::vector<std::int32_t> labels;
  std::vector<std::string> names;
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    const MaterialId m = image.voxels[v];
    if (number[m] == kOutside) {
      number[m] = static_cast<MaterialId>(labels.size());
      labels.push_back(image.labels[m]);
      if (!image.names.empty()) names.push_back(image.names[m]);
    }
    image.voxels.set(v, number[m]);
  }
  image.labels = std::move(labels);
  image.names = std::move(names);
}

}  // namespace

template <int Dim>
CleanUpReport clean_up(LabelImage<Dim>& image, const CleanUpOptions& options, Execution& execution) {
  CleanUpReport report;
  if (options.remove_islands <= 0 && options.fill_holes <= 0) return report;
  const Execution::Stage stage(execution, "clean up");
  const MaterialId background = material_of(image.labels, options.background);
  if (options.remove_islands > 0) {
    const ComponentMap map = map_components(image, execution);
    const std::vector<std::uint8_t> gone =
        absorb(image, map, find_islands(map.components, image.labels.size(), background, options.remove_islands));
    std::vector<CleanedLabel> by_material(image.labels.size());
    for (std::size_t c = 0; c < gone.size(); ++c) {
      if (gone[c] == 0) continue;
      CleanedLabel& cleaned = by_material[map.components[c].material];
      ++cleaned.components;
      cleaned.voxels += map.components[c].voxels;
    }
    for (std::size_t m = 0; m < by_material.size(); ++m) {
      by_material[m].label = image.labels[m];
      if (by_material[m].components > 0) report.islands.push_back(by_material[m]);
    }
    std::ranges::sort(report.islands, {}, &CleanedLabel::label);
  }
  report.holes.label = options.background;
  if (options.fill_holes > 0 && background != kOutside) {
    const ComponentMap map = map_components(image, execution);
    const std::vector<std::uint8_t> gone = absorb(image, map, find_holes(image, map, background, options.fill_holes));
    for (std::size_t c = 0; c < gone.size(); ++c) {
      report.holes.components += gone[c];
      report.holes.voxels += gone[c] != 0 ? map.components[c].voxels : 0;
    }
  }
  renumber(image);
  return report;
}

template CleanUpReport clean_up(LabelImage<2>&, const CleanUpOptions&, Execution&);
template CleanUpReport clean_up(LabelImage<3>&, const CleanUpOptions&, Execution&);
template CleanUpReport clean_up(LabelImage<4>&, const CleanUpOptions&, Execution&);

}  // namespace treemarch
