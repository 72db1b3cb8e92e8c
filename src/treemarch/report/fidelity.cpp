#include "treemarch/report/fidelity.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/report/components.h"
#include "treemarch/report/mesh_components.h"
#include "treemarch/report/simplices.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 1 << 13;  // cells a task
constexpr double kTolerance = 1e-9;       // of barycentric coordinates

/// Some cells of one block.
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

/// Voxels whose centres lie between two planes across one axis: first and one past the last, within the image.
struct Span {
  std::int32_t begin, end;
};

template <int Dim>
Span centres_between(const Simplex<Dim>& simplex, int axis, double voxels_per_length, std::int32_t extent) {
  constexpr double kSlack = 1e-9;
  double lo = simplex[0][axis], hi = lo;
  for (const Vec<Dim>& p : simplex) {
    lo = std::min(lo, p[axis]);
    hi = std::max(hi, p[axis]);
  }
  const double begin = std::ceil(lo * voxels_per_length - 0.5 - kSlack);
  const double end = std::floor(hi * voxels_per_length - 0.5 + kSlack) + 1;
  return {static_cast<std::int32_t>(std::clamp(begin, 0.0, static_cast<double>(extent))),
          static_cast<std::int32_t>(std::clamp(end, 0.0, static_cast<double>(extent)))};
}

/// Replaces a value by a smaller one, whatever other threads do at the same time.
template <class T>
void lower(T& value, T to) {
  const std::atomic_ref<T> shared(value);
  T now = shared.load(std::memory_order_relaxed);
  while (to < now && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// Gives each voxel the material of the simplex that contains its centre. Where several do, its own material wins, then
/// the smallest: the same for any order of the simplices.
template <class T, int Dim>
class Painter {
 public:
  static constexpr T kNone = std::numeric_limits<T>::max();
  static constexpr T kOwn = 0;  ///< the voxel's own material; others are stored as their number + 1

  explicit Painter(const LabelImage<Dim>& image)
      : image_(image), owner_(static_cast<std::size_t>(product(image.extent)), kNone) {
    for (int d = 0; d < Dim; ++d) voxels_per_length_[d] = 1 / image.frame.spacing[d];
  }

  void paint(const Simplex<Dim>& simplex, MaterialId material) {
    std::array<Span, Dim> spans;
    for (int d = 0; d < Dim; ++d) {
      spans[d] = centres_between(simplex, d, voxels_per_length_[d], image_.extent[d]);
      if (spans[d].begin >= spans[d].end) return;
    }
    const Barycentric<Dim> barycentric(simplex);
    if (!barycentric.is_valid()) return;
    Coord<Dim> voxel;
    for (int d = 0; d < Dim; ++d) voxel[d] = spans[d].begin;
    while (true) {
      const std::int64_t v = linear_index(voxel, image_.extent);
      const T paint = image_.voxels[v] == material ? kOwn : static_cast<T>(material + 1);
      T& owner = owner_[static_cast<std::size_t>(v)];
      if (paint < std::atomic_ref(owner).load(std::memory_order_relaxed)) {
        Vec<Dim> centre;
        for (int d = 0; d < Dim; ++d) centre[d] = (voxel[d] + 0.5) * image_.frame.spacing[d];
        if (barycentric.contains(centre, kTolerance)) lower(owner, paint);
      }
      int d = 0;
      while (d < Dim && ++voxel[d] == spans[d].end) {
        voxel[d] = spans[d].begin;
        ++d;
      }
      if (d == Dim) return;
    }
  }
  [[nodiscard]] const std::vector<T>& owner() const { return owner_; }

 private:
  const LabelImage<Dim>& image_;
  Vec<Dim> voxels_per_length_{};
  std::vector<T> owner_;
};

/// Voxels by label: in the image, in the mesh, and in both.
struct Overlap {
  std::vector<std::int64_t> image, mesh, both;
  explicit Overlap(std::size_t n = 0) : image(n), mesh(n), both(n) {}
};

template <class T, int Dim>
Overlap overlap(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const std::vector<MaterialId>& to_image,
                const Execution& execution) {
  Painter<T, Dim> painter(image);
  const auto ranges = split_into_ranges(mesh);
  parallel_for(execution, std::ssize(ranges), 1, [&](std::int64_t r) {
    const CellRange<Dim>& range = ranges[static_cast<std::size_t>(r)];
    for (std::int64_t c = range.begin; c < range.end; ++c) {
      const MaterialId material = to_image[range.block->materials[static_cast<std::size_t>(c)]];
      if (material == kOutside) continue;
      for_each_simplex(mesh, *range.block, c, [&](const Simplex<Dim>& simplex) { painter.paint(simplex, material); });
    }
  });

  constexpr std::int64_t kTables = 16;  // bounds the memory where there are many labels
  const std::size_t materials = image.labels.size();
  const std::int64_t voxels = product(image.extent), block = block_count(voxels, kTables);
  std::vector<Overlap> partial(static_cast<std::size_t>(block_count(voxels, block)));
  parallel_for(execution, std::ssize(partial), 1, [&](std::int64_t b) {
    Overlap& sum = partial[static_cast<std::size_t>(b)] = Overlap(materials);
    for (std::int64_t v = b * block; v < std::min(voxels, (b + 1) * block); ++v) {
      const MaterialId in_image = image.voxels[v];
      const T paint = painter.owner()[static_cast<std::size_t>(v)];
      ++sum.image[in_image];
      if (paint == Painter<T, Dim>::kNone) continue;
      if (paint == Painter<T, Dim>::kOwn) {
        ++sum.mesh[in_image];
        ++sum.both[in_image];
      } else {
        ++sum.mesh[paint - 1];
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

/// \param to_image the image's material of each material of the mesh.
template <int Dim>
Overlap overlap(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, const std::vector<MaterialId>& to_image,
                const Execution& execution) {
  if (image.labels.size() < 0xfe) return overlap<std::uint8_t>(image, mesh, to_image, execution);
  if (image.labels.size() < 0xfffe) return overlap<std::uint16_t>(image, mesh, to_image, execution);
  return overlap<std::uint32_t>(image, mesh, to_image, execution);
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
