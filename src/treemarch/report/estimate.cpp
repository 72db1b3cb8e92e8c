#include "treemarch/report/estimate.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {
namespace {

// Fitted to runs over images of 0.07 to 450 million voxels, of which none is off by more than two fifths.
constexpr double kCellsPerLeaf[] = {0, 0, 4, 12};
constexpr double kCellsPerArea[] = {0, 0, 20, 38};  // of interfaces, in units of the smallest cell
constexpr double kBytesPerCell = 55;
constexpr double kBytesPerVoxel = 2.5;  // beside the image
constexpr double kBytesAlways = 50e6;
constexpr double kScratchPerMemory = 1.5;  // beyond half of what may be used; pieces leave gaps

}  // namespace

namespace {

/// Faces between different voxels, by the axis they are normal to.
template <int Dim>
using Faces = std::array<std::int64_t, Dim>;

template <int Dim>
Faces<Dim> count_faces(const LabelImage<Dim>& image, const Execution& execution) {
  std::array<std::int64_t, Dim> stride{};
  for (std::int64_t d = 0, n = 1; d < Dim; n *= image.extent[d++]) stride[d] = n;
  const UniformBlocks<Dim> uniform(image, execution);
  return image.voxels.visit([&](const auto* v) {
    // Those of a voxel to the next ones along the axes.
    const auto count = [&](std::int64_t begin, std::int64_t end) {
      Faces<Dim> faces{};
      for (std::int64_t b = begin; b < end; ++b) {
        const VoxelBox<Dim> box = voxels_of_block(coord_of(b, uniform.extent()), image.extent);
        if (uniform.within(box.begin, box.end) != UniformBlocks<Dim>::kMixed) continue;
        for_each_row(box, image.extent, [&](const Coord<Dim>& c, std::int64_t at) {
          const std::int64_t n = box.end[0] - c[0];
          for (std::int64_t i = at; i < at + (box.end[0] < image.extent[0] ? n : n - 1); ++i)
            faces[0] += v[i] != v[i + 1];
          for (int d = 1; d < Dim; ++d)
            for (std::int64_t i = at; i < at + n && c[d] + 1 < image.extent[d]; ++i)
              faces[d] += v[i] != v[i + stride[d]];
        });
      }
      return faces;
    };
    return parallel_reduce(execution, uniform.size(), 256, Faces<Dim>{}, count, [](Faces<Dim> a, const Faces<Dim>& b) {
      for (int d = 0; d < Dim; ++d) a[d] += b[d];
      return a;
    });
  });
}

std::int64_t limit_in(const char* path, std::string_view key) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);)
    if (line.starts_with(key)) {
      const char* number = line.c_str() + key.size();
      return std::strtoll(number, nullptr, 10);
    }
  return 0;
}

}  // namespace

template <int Dim>
MeshEstimate estimate_mesh(const LabelImage<Dim>& image, const SizingRule& sizes, bool grey,
                           const Execution& execution) {
  const double voxel = image.voxel_volume();
  double volume = 1;
  for (const double side : image.size()) volume *= side;
  MeshEstimate estimate;
  const Faces<Dim> faces = count_faces(image, execution);
  for (int d = 0; d < Dim; ++d)
    estimate.interface_area += static_cast<double>(faces[d]) * voxel / image.frame.spacing[d];
  const double smallest = sizes.min_size > 0 ? sizes.min_size : *std::ranges::min_element(image.frame.spacing);
  const double largest = sizes.max_size > 0 ? sizes.max_size : kDefaultCoarsening * smallest;
  const double cells = kCellsPerArea[Dim] * estimate.interface_area / std::pow(smallest, Dim - 1) +
                       kCellsPerLeaf[Dim] * volume / std::pow(largest, Dim);
  estimate.cells = static_cast<std::int64_t>(std::min(cells, 1e18));
  // Sizes by place are searched for with a mark a voxel.
  const bool by_place = !sizes.voxel_size.empty() || !sizes.few_voxels.empty();
  const double per_voxel = kBytesPerVoxel + image.voxels.width() + (grey ? sizeof(float) : 0) +
                           (sizes.voxel_size.empty() ? 0 : sizeof(float)) + (by_place ? 1 : 0);
  estimate.memory_bytes = static_cast<std::int64_t>(
      std::min(kBytesAlways + kBytesPerCell * cells + per_voxel * static_cast<double>(product(image.extent)), 1e18));
  return estimate;
}

std::int64_t available_memory_bytes() {
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  if (const std::int64_t kilobytes = limit_in("/proc/meminfo", "MemAvailable:"); kilobytes > 0)
    least = kilobytes * 1024;
  for (const char* limit : {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"})
    if (const std::int64_t group = limit_in(limit, ""); group > 0) least = std::min(least, group);
  return least;
}

std::int64_t parse_bytes(std::string_view text, std::string_view option) {
  const struct {
    std::string_view suffix;
    double bytes;
  } units[] = {{"GiB", 0x1p30}, {"MiB", 0x1p20}, {"GB", 1e9}, {"MB", 1e6}, {"G", 1e9}, {"M", 1e6}, {"", 1}};
  for (const auto& unit : units) {
    if (!text.ends_with(unit.suffix)) continue;
    const std::string_view number = text.substr(0, text.size() - unit.suffix.size());
    double value = 0;
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error == std::errc{} && end == number.data() + number.size() && value > 0 && value * unit.bytes < 1e18)
      return static_cast<std::int64_t>(value * unit.bytes);
    break;
  }
  throw Error(ErrorKind::usage,
              std::string(option) + ": '" + std::string(text) + "' is no amount of memory; write 12GB, 900MB or 8GiB");
}

std::string describe(const MeshEstimate& estimate, std::int64_t most) {
  char text[128];
  std::snprintf(text, sizeof text, "about %.1f million cells need about %.1f GB, and %.1f GB may be used",
                static_cast<double>(estimate.cells) / 1e6, static_cast<double>(estimate.memory_bytes) / 1e9,
                static_cast<double>(most) / 1e9);
  return text;
}

void require_memory(const MeshEstimate& estimate, std::int64_t most) {
  if (estimate.memory_bytes <= most) return;
  throw Error(ErrorKind::limits, "--min-size: " + describe(estimate, most) +
                                     "; choose larger cells, a part of the image (--roi), or a limit (--max-memory) "
                                     "beyond which a disk is used");
}

void require_disk(const MeshEstimate& estimate, std::int64_t most, std::int64_t room, const std::string& folder) {
  const double file = kScratchPerMemory * (static_cast<double>(estimate.memory_bytes) - static_cast<double>(most) / 2);
  if (estimate.memory_bytes <= most || file <= static_cast<double>(room)) return;
  char disk[96];
  std::snprintf(disk, sizeof disk, ", with a file of %.1f GB, for which %.1f GB are free in ", file / 1e9,
                static_cast<double>(room) / 1e9);
  throw Error(ErrorKind::limits, "--max-memory: " + describe(estimate, most) + disk + folder +
                                     "; name another one (--scratch) or choose larger cells (--min-size)");
}

template MeshEstimate estimate_mesh(const LabelImage<2>&, const SizingRule&, bool, const Execution&);
template MeshEstimate estimate_mesh(const LabelImage<3>&, const SizingRule&, bool, const Execution&);

}  // namespace treemarch
