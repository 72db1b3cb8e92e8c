#include "treemarch/report/fidelity.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/report/components.h"
#include "treemarch/report/simplices.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 16;  // cells a task
constexpr double kTolerance = 1e-9;       // of barycentric coordinates

/// All simplices of a mesh as one sequence: blocks of cells, each cell split into its simplices.
template <int Dim>
struct CellRange {
  const CellBlock* block;
  std::int64_t begin, end;
};

template <int Dim>
std::vector<CellRange<Dim>> split_into_ranges(const Mesh<Dim>& mesh) {
  std::vector<CellRange<Dim>> ranges;
  for (const CellBlock& block : mesh.blocks) {
    if (dimension(block.type) != Dim) continue;
    for (std::int64_t i = 0; i < block.size(); i += kBlock)
      ranges.push_back({&block, i, std::min(block.size(), i + kBlock)});
  }
  return ranges;
}

/// Voxels whose centres lie within [lo, hi] on one axis: first and one past the last, within the image.
struct Span {
  std::int32_t begin, end;
};
Span centres_between(double lo, double hi, double spacing, std::int32_t extent) {
  const double slack = 1e-9;
  const double b = std::ceil(lo / spacing - 0.5 - slack);
  const double e = std::floor(hi / spacing - 0.5 + slack) + 1;
  return {static_cast<std::int32_t>(std::clamp(b, 0.0, static_cast<double>(extent))),
          static_cast<std::int32_t>(std::clamp(e, 0.0, static_cast<double>(extent)))};
}

template <int Dim>
Span centres_between(const Simplex<Dim>& simplex, int axis, const LabelImage<Dim>& image) {
  double lo = simplex[0][axis], hi = lo;
  for (const Vec<Dim>& p : simplex) {
    lo = std::min(lo, p[axis]);
    hi = std::max(hi, p[axis]);
  }
  return centres_between(lo, hi, image.frame.spacing[axis], image.extent[axis]);
}

/// The cells that may hold a voxel centre of each layer of voxels (a layer is a fixed last coordinate), in the order of
/// the cells.
struct Layers {
  struct Entry {
    std::uint32_t range;  // index of the CellRange
    std::uint32_t cell;   // within it
  };
  std::vector<std::int64_t> begin;  // per layer and one past the last
  std::vector<Entry> entries;
};

template <int Dim, class F>
void for_each_layer_of(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const CellRange<Dim>& range, F&& f) {
  const int n = vertex_count(range.block->type);
  for (std::int64_t c = range.begin; c < range.end; ++c) {
    const VertexId* v = range.block->cell(c);
    double lo = mesh.points[v[0]][Dim - 1], hi = lo;
    for (int i = 1; i < n; ++i) {
      lo = std::min(lo, mesh.points[v[i]][Dim - 1]);
      hi = std::max(hi, mesh.points[v[i]][Dim - 1]);
    }
    const Span span = centres_between(lo, hi, image.frame.spacing[Dim - 1], image.extent[Dim - 1]);
    for (std::int32_t z = span.begin; z < span.end; ++z) f(z, static_cast<std::uint32_t>(c - range.begin));
  }
}

template <int Dim>
Layers sort_into_layers(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const std::vector<CellRange<Dim>>& ranges,
                        const Execution& execution) {
  const auto layers = static_cast<std::size_t>(image.extent[Dim - 1]);
  const std::size_t n = ranges.size();
  std::vector<std::int64_t> at(layers * n);  // layer-major, so that a scan puts the cells of a layer in their order
  parallel_for(execution, static_cast<std::int64_t>(n), 1, [&](std::int64_t r) {
    for_each_layer_of(image, mesh, ranges[static_cast<std::size_t>(r)],
                      [&](std::int32_t z, std::uint32_t) { ++at[static_cast<std::size_t>(z) * n + r]; });
  });
  Layers result;
  result.entries.resize(static_cast<std::size_t>(exclusive_scan(std::span(at))));
  for (std::size_t z = 0; z < layers; ++z) result.begin.push_back(n ? at[z * n] : 0);
  result.begin.push_back(static_cast<std::int64_t>(result.entries.size()));
  parallel_for(execution, static_cast<std::int64_t>(n), 1, [&](std::int64_t r) {
    for_each_layer_of(image, mesh, ranges[static_cast<std::size_t>(r)], [&](std::int32_t z, std::uint32_t cell) {
      result.entries[static_cast<std::size_t>(at[static_cast<std::size_t>(z) * n + r]++)] = {
          static_cast<std::uint32_t>(r), cell};
    });
  });
  return result;
}

/// Calls f(voxel within the layer) for the voxel centres of layer z that a simplex contains.
template <int Dim, class F>
void for_each_centre(const Simplex<Dim>& simplex, const LabelImage<Dim>& image, std::int32_t z, F&& f) {
  std::array<Span, Dim> spans;
  for (int d = 0; d < Dim - 1; ++d) {
    spans[d] = centres_between(simplex, d, image);
    if (spans[d].begin >= spans[d].end) return;
  }
  spans[Dim - 1] = {z, z + 1};
  const Barycentric<Dim> barycentric(simplex);
  if (!barycentric.is_valid()) return;
  Coord<Dim> voxel;
  for (int d = 0; d < Dim; ++d) voxel[d] = spans[d].begin;
  while (true) {
    Vec<Dim> centre;
    for (int d = 0; d < Dim; ++d) centre[d] = (voxel[d] + 0.5) * image.frame.spacing[d];
    if (barycentric.contains(centre, kTolerance)) {
      Coord<Dim> in_layer = voxel;
      in_layer[Dim - 1] = 0;
      f(linear_index(in_layer, image.extent));
    }
    int d = 0;
    while (d < Dim - 1 && ++voxel[d] == spans[d].end) {
      voxel[d] = spans[d].begin;
      ++d;
    }
    if (d >= Dim - 1) return;
  }
}

/// Voxels by label: in the image, in the mesh, and in both.
struct Overlap {
  std::vector<std::int64_t> image, mesh, both;
  explicit Overlap(std::size_t n = 0) : image(n), mesh(n), both(n) {}
};

constexpr MaterialId kNoCell = kOutside;

/// \param to_image the image's material of each material of the mesh.
template <int Dim>
Overlap overlap(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const std::vector<MaterialId>& to_image,
                const Execution& execution) {
  const auto ranges = split_into_ranges(mesh);
  const Layers layers = sort_into_layers(image, mesh, ranges, execution);
  const std::int64_t layer_size = product(image.extent) / image.extent[Dim - 1];
  const std::size_t materials = image.labels.size();
  const std::int64_t group = block_count(image.extent[Dim - 1], 64);  // bounds the number of tables
  const std::int64_t groups = block_count(image.extent[Dim - 1], group);
  std::vector<Overlap> partial(static_cast<std::size_t>(groups));
  parallel_for(execution, groups, 1, [&](std::int64_t g) {
    Overlap& sum = partial[static_cast<std::size_t>(g)] = Overlap(materials);
    std::vector<MaterialId> owner(static_cast<std::size_t>(layer_size));
    const std::int64_t end = std::min<std::int64_t>(image.extent[Dim - 1], (g + 1) * group);
    for (std::int64_t z = g * group; z < end; ++z) {
      std::fill(owner.begin(), owner.end(), kNoCell);
      for (std::int64_t e = layers.begin[static_cast<std::size_t>(z)];
           e < layers.begin[static_cast<std::size_t>(z) + 1]; ++e) {
        const Layers::Entry entry = layers.entries[static_cast<std::size_t>(e)];
        const CellRange<Dim>& range = ranges[entry.range];
        const std::int64_t cell = range.begin + entry.cell;
        const MaterialId material = to_image[range.block->materials[static_cast<std::size_t>(cell)]];
        if (material == kOutside) continue;
        for_each_simplex(mesh, *range.block, cell, [&](const Simplex<Dim>& simplex) {
          for_each_centre(simplex, image, static_cast<std::int32_t>(z), [&](std::int64_t v) {
            MaterialId& o = owner[static_cast<std::size_t>(v)];
            if (o == kNoCell) o = material;
          });
        });
      }
      for (std::int64_t v = 0; v < layer_size; ++v) {
        const MaterialId in_image = image.voxels[z * layer_size + v], in_mesh = owner[static_cast<std::size_t>(v)];
        ++sum.image[in_image];
        if (in_mesh == kNoCell) continue;
        ++sum.mesh[in_mesh];
        if (in_mesh == in_image) ++sum.both[in_image];
      }
    }
  });
  Overlap total(materials);
  for (const Overlap& p : partial) {
    for (std::size_t m = 0; m < materials; ++m) {
      total.image[m] += p.image[m];
      total.mesh[m] += p.mesh[m];
      total.both[m] += p.both[m];
    }
  }
  return total;
}

struct CellSums {
  std::vector<std::int64_t> cells;
  std::vector<double> volume;
};

/// Cells and volume by material of the mesh.
template <int Dim>
CellSums sum_cells(const Mesh<Dim>& mesh, const Execution& execution) {
  const auto ranges = split_into_ranges(mesh);
  const std::size_t n = mesh.labels.size();
  // A few tables, each filled in order, whatever the number of threads.
  const std::int64_t group = block_count(static_cast<std::int64_t>(ranges.size()), 64);
  const std::int64_t groups = ranges.empty() ? 0 : block_count(static_cast<std::int64_t>(ranges.size()), group);
  std::vector<CellSums> partial(static_cast<std::size_t>(groups));
  parallel_for(execution, groups, 1, [&](std::int64_t g) {
    CellSums& sum = partial[static_cast<std::size_t>(g)];
    sum.cells.resize(n);
    sum.volume.resize(n);
    for (std::int64_t r = g * group; r < std::min<std::int64_t>(std::ssize(ranges), (g + 1) * group); ++r) {
      const CellRange<Dim>& range = ranges[static_cast<std::size_t>(r)];
      for (std::int64_t c = range.begin; c < range.end; ++c) {
        const MaterialId m = range.block->materials[static_cast<std::size_t>(c)];
        ++sum.cells[m];
        sum.volume[m] += cell_volume(mesh.points.data(), range.block->type, range.block->cell(c));
      }
    }
  });
  CellSums total{std::vector<std::int64_t>(n), std::vector<double>(n)};
  for (const CellSums& p : partial) {
    for (std::size_t m = 0; m < n; ++m) {
      total.cells[m] += p.cells[m];
      total.volume[m] += p.volume[m];
    }
  }
  return total;
}

/// The image's material of each material of the mesh, kOutside where the image lacks the label.
std::vector<MaterialId> match_labels(const std::vector<std::int32_t>& mesh, const std::vector<std::int32_t>& image) {
  std::vector<MaterialId> by_value(image.size());
  std::iota(by_value.begin(), by_value.end(), 0U);
  const auto value = [&](MaterialId m) { return image[m]; };
  std::ranges::sort(by_value, {}, value);
  std::vector<MaterialId> match;
  for (const std::int32_t label : mesh) {
    const auto at = std::ranges::lower_bound(by_value, label, {}, value);
    match.push_back(at != by_value.end() && image[*at] == label ? *at : kOutside);
  }
  return match;
}

}  // namespace

std::vector<std::int32_t> Fidelity::lost_labels() const {
  std::vector<std::int32_t> lost;
  for (const LabelFidelity& l : labels)
    if (l.voxels > 0 && l.cells == 0 && !l.is_background) lost.push_back(l.label);
  return lost;
}

double Fidelity::mean_dice() const {
  double sum = 0;
  std::int64_t n = 0;
  for (const LabelFidelity& l : labels) {
    if (l.is_background || l.voxels == 0) continue;
    sum += l.dice;
    ++n;
  }
  return n ? sum / static_cast<double>(n) : 0;
}

template <int Dim>
Fidelity measure_labels(const Mesh<Dim>& mesh, const Execution& execution) {
  const CellSums sums = sum_cells(mesh, execution);
  const std::vector<std::int64_t> components = count_mesh_components(mesh, execution);
  Fidelity fidelity;
  fidelity.labels.resize(mesh.labels.size());
  for (std::size_t m = 0; m < mesh.labels.size(); ++m) {
    LabelFidelity& l = fidelity.labels[m];
    l.label = mesh.labels[m];
    if (!mesh.names.empty()) l.name = mesh.names[m];
    l.cells = sums.cells[m];
    l.volume = sums.volume[m];
    l.components = components[m];
  }
  std::ranges::sort(fidelity.labels, {}, &LabelFidelity::label);
  return fidelity;
}

template <int Dim>
Fidelity measure_fidelity(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::int32_t background,
                          const Execution& execution) {
  const std::vector<MaterialId> to_image = match_labels(mesh.labels, image.labels);
  const Overlap voxels = overlap(image, mesh, to_image, execution);
  double voxel_volume = 1;
  for (const double s : image.frame.spacing) voxel_volume *= s;

  Fidelity fidelity;
  fidelity.labels.resize(image.labels.size());
  for (std::size_t m = 0; m < image.labels.size(); ++m) {
    LabelFidelity& l = fidelity.labels[m];
    l.label = image.labels[m];
    if (!image.names.empty()) l.name = image.names[m];
    l.voxels = voxels.image[m];
    l.image_volume = static_cast<double>(l.voxels) * voxel_volume;
    const std::int64_t both = voxels.image[m] + voxels.mesh[m];
    l.dice = both ? 2.0 * static_cast<double>(voxels.both[m]) / static_cast<double>(both) : 0;
    l.is_background = l.label == background;
  }
  for (const ImageComponent& c : image_components(image)) ++fidelity.labels[c.material].image_components;
  std::ranges::sort(fidelity.labels, {}, &LabelFidelity::label);

  for (const LabelFidelity& in_mesh : measure_labels(mesh, execution).labels) {
    const auto at = std::ranges::lower_bound(fidelity.labels, in_mesh.label, {}, &LabelFidelity::label);
    if (at == fidelity.labels.end() || at->label != in_mesh.label) {
      fidelity.unknown_cells += in_mesh.cells;
      continue;
    }
    at->cells += in_mesh.cells;
    at->volume += in_mesh.volume;
    at->components += in_mesh.components;
  }
  return fidelity;
}

template Fidelity measure_labels(const Mesh<2>&, const Execution&);
template Fidelity measure_labels(const Mesh<3>&, const Execution&);
template Fidelity measure_fidelity(const LabelImage<2>&, const Mesh<2>&, std::int32_t, const Execution&);
template Fidelity measure_fidelity(const LabelImage<3>&, const Mesh<3>&, std::int32_t, const Execution&);

}  // namespace treemarch
