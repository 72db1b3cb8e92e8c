#include "treemarch/report/fidelity.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/report/cell_sums.h"
#include "treemarch/topology/component_fates.h"
#include "treemarch/topology/image_components.h"
#include "treemarch/topology/mesh_components.h"
#include "treemarch/topology/simplices.h"
#include "treemarch/topology/voxel_centres.h"

namespace treemarch {
namespace {

/// Replaces a value by a smaller one, whatever other threads do at the same time.
template <class T>
void lower(T& value, T to) {
  const std::atomic_ref<T> shared(value);
  if (to == 0) return shared.store(0, std::memory_order_relaxed);  // nothing is smaller
  T now = shared.load(std::memory_order_relaxed);
  while (to < now && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// Voxels by label: in the image, in the mesh, and in both.
struct Overlap {
  std::vector<std::int64_t> image, mesh, both;
  explicit Overlap(std::size_t n = 0) : image(n), mesh(n), both(n) {}
  void add(const Overlap& other) {
    for (std::size_t m = 0; m < image.size(); ++m) {
      image[m] += other.image[m];
      mesh[m] += other.mesh[m];
      both[m] += other.both[m];
    }
  }
};

/// Gives each voxel the material of the simplex that contains its centre. Where several do, its own material wins, then
/// the smallest: the same for any order of the simplices.
template <class T, int Dim>
class Painter {
 public:
  static constexpr T kNone = std::numeric_limits<T>::max();
  static constexpr T kOwn = 0;  ///< the voxel's own material; others are stored as their number + 1

  /// Only the first voxel of a plain block is painted.
  Painter(const LabelImage<Dim>& image, const PlainBlocks<Dim>& plain, const Execution& execution)
      : image_(image),
        plain_(plain),
        centres_(image),
        owner_(std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(product(image.extent)))) {
    parallel_for(execution, plain.size(), 256, [&](std::int64_t b) {
      const VoxelBox<Dim> box = voxels_of_block(coord_of(b, plain.extent()), image.extent);
      if (plain[b])
        owner_[static_cast<std::size_t>(linear_index(box.begin, image.extent))] = kNone;
      else
        for_each_row(box, image.extent, [&](const Coord<Dim>& c, std::int64_t at) {
          std::fill_n(owner_.get() + at, box.end[0] - c[0], kNone);
        });
    });
  }

  void paint(const Simplex<Dim>& simplex, MaterialId material) {
    const auto paint_for = [&](std::int64_t v) {
      return image_.voxels[v] == material ? kOwn : static_cast<T>(material + 1);
    };
    centres_.visit(
        simplex, plain_.extent(), [&](std::int64_t b) { return plain_[b] ? Look::at_first : Look::at_all; },
        [&](std::int64_t v) {
          return paint_for(v) < std::atomic_ref(owner_[static_cast<std::size_t>(v)]).load(std::memory_order_relaxed);
        },
        [&](std::int64_t v) { lower(owner_[static_cast<std::size_t>(v)], paint_for(v)); });
  }

  /// Adds the voxels of a block.
  void count(std::int64_t block, Overlap& sum) const {
    const VoxelBox<Dim> box = voxels_of_block(coord_of(block, plain_.extent()), image_.extent);
    if (plain_[block]) return count(linear_index(box.begin, image_.extent), box.size(), sum);
    for_each_row(box, image_.extent, [&](const Coord<Dim>& c, std::int64_t at) {
      for (std::int64_t v = at; v < at + box.end[0] - c[0]; ++v) count(v, 1, sum);
    });
  }

 private:
  void count(std::int64_t voxel, std::int64_t times, Overlap& sum) const {
    const MaterialId in_image = image_.voxels[voxel];
    const T paint = owner_[static_cast<std::size_t>(voxel)];
    sum.image[in_image] += times;
    if (paint == kNone) return;
    sum.mesh[paint == kOwn ? in_image : paint - 1] += times;
    if (paint == kOwn) sum.both[in_image] += times;
  }

  const LabelImage<Dim>& image_;
  const PlainBlocks<Dim>& plain_;
  VoxelCentres<Dim> centres_;
  std::unique_ptr<T[]> owner_;
};

template <class T, int Dim>
Overlap overlap(const LabelImage<Dim>& image, const PlainBlocks<Dim>& plain, const Mesh<Dim>& mesh,
                const std::vector<MaterialId>& to_image, const Execution& execution) {
  Painter<T, Dim> painter(image, plain, execution);
  const auto ranges = cell_ranges(mesh);
  parallel_for(execution, std::ssize(ranges), 1, [&](std::int64_t r) {
    const CellRange<Dim>& range = ranges[static_cast<std::size_t>(r)];
    for (std::int64_t c = range.begin; c < range.end; ++c) {
      const MaterialId material = to_image[range.block->materials[static_cast<std::size_t>(c)]];
      if (material == kOutside) continue;
      for_each_simplex(mesh, *range.block, c, [&](const Simplex<Dim>& simplex) { painter.paint(simplex, material); });
    }
  });

  constexpr std::int64_t kTables = 16;  // bounds the memory where there are many labels
  return parallel_reduce(
      execution, plain.size(), block_count(plain.size(), kTables), Overlap(image.labels.size()),
      [&](std::int64_t begin, std::int64_t end) {
        Overlap sum(image.labels.size());
        for (std::int64_t b = begin; b < end; ++b) painter.count(b, sum);
        return sum;
      },
      [](Overlap a, const Overlap& b) {
        a.add(b);
        return a;
      });
}

/// \param to_image the image's material of each material of the mesh.
template <int Dim>
Overlap overlap(const LabelImage<Dim>& image, const PlainBlocks<Dim>& plain, const Mesh<Dim>& mesh,
                const std::vector<MaterialId>& to_image, const Execution& execution) {
  if (image.labels.size() < 0xfe) return overlap<std::uint8_t>(image, plain, mesh, to_image, execution);
  if (image.labels.size() < 0xfffe) return overlap<std::uint16_t>(image, plain, mesh, to_image, execution);
  return overlap<std::uint32_t>(image, plain, mesh, to_image, execution);
}

template <int Dim>
Fidelity label_sums(const Mesh<Dim>& mesh, const MeshComponents<Dim>& components, const Execution& execution) {
  const CellSums sums = sum_cells(mesh, execution);
  const std::vector<std::int64_t> count = components.count(execution);
  Fidelity fidelity;
  fidelity.labels.resize(mesh.labels.size());
  for (std::size_t m = 0; m < mesh.labels.size(); ++m) {
    LabelFidelity& l = fidelity.labels[m];
    l.label = mesh.labels[m];
    if (!mesh.names.empty()) l.name = mesh.names[m];
    l.cells = sums.cells[m];
    l.volume = sums.volume[m];
    l.components = count[m];
  }
  std::ranges::sort(fidelity.labels, {}, &LabelFidelity::label);
  return fidelity;
}

/// What the image says about the labels, and how the voxels in the mesh agree.
template <int Dim>
std::vector<LabelFidelity> compare_labels(const LabelImage<Dim>& image, const Overlap& voxels, const ComponentMap& map,
                                          std::int32_t background) {
  std::vector<LabelFidelity> labels(image.labels.size());
  for (std::size_t m = 0; m < image.labels.size(); ++m) {
    LabelFidelity& l = labels[m];
    l.label = image.labels[m];
    if (!image.names.empty()) l.name = image.names[m];
    l.voxels = voxels.image[m];
    l.image_volume = static_cast<double>(l.voxels) * image.voxel_volume();
    const std::int64_t both = voxels.image[m] + voxels.mesh[m];
    l.dice = both ? 2.0 * static_cast<double>(voxels.both[m]) / static_cast<double>(both) : 0;
    l.is_background = l.label == background;
  }
  for (const ImageComponent& c : map.components) ++labels[c.material].image_components;
  std::ranges::sort(labels, {}, &LabelFidelity::label);
  return labels;
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
  return label_sums(mesh, MeshComponents<Dim>(mesh, execution), execution);
}

template <int Dim>
Fidelity measure_fidelity(const LabelImage<Dim>& image, const Mesh<Dim>& mesh, std::int32_t background,
                          const Execution& execution, std::int64_t min_component, const Borders* borders) {
  const std::vector<MaterialId> to_image = match_labels(mesh.labels, image.labels);
  const ComponentMap map = map_components(image, execution);
  const MeshComponents<Dim> components(mesh, execution, {.borders = borders});
  const UniformBlocks<Dim> uniform(image, execution);
  const PlainBlocks<Dim> plain(image, uniform, mesh, components.facets(), execution);
  Fidelity fidelity;
  fidelity.labels = compare_labels(image, overlap(image, plain, mesh, to_image, execution), map, background);
  for (const LabelFidelity& in_mesh : label_sums(mesh, components, execution).labels) {
    const auto at = std::ranges::lower_bound(fidelity.labels, in_mesh.label, {}, &LabelFidelity::label);
    if (at == fidelity.labels.end() || at->label != in_mesh.label) {
      fidelity.unknown_cells += in_mesh.cells;
      continue;
    }
    at->cells += in_mesh.cells;
    at->volume += in_mesh.volume;
    at->components += in_mesh.components;
  }
  if constexpr (Dim < 4) {
    fidelity.interfaces = measure_interfaces(image, mesh, to_image, background, components.facets(), execution);
    const std::vector<ComponentFate> fates =
        component_fates(image, map, mesh, components, plain, to_image, execution).of;
    fidelity.topology =
        report_topology<Dim>({image, uniform, mesh, map, components, fates}, background, min_component, execution);
  }
  return fidelity;
}

template Fidelity measure_labels(const Mesh<2>&, const Execution&);
template Fidelity measure_labels(const Mesh<3>&, const Execution&);
template Fidelity measure_labels(const Mesh<4>&, const Execution&);
#define TREEMARCH_INSTANTIATE(DIM)                                                                             \
  template Fidelity measure_fidelity(const LabelImage<DIM>&, const Mesh<DIM>&, std::int32_t, const Execution&, \
                                     std::int64_t, const Borders*);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
