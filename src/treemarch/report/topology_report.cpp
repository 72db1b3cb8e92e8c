#include "treemarch/report/topology_report.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "treemarch/core/parallel.h"
#include "treemarch/topology/pinches.h"

namespace treemarch {
namespace {

template <int Dim>
Vec<3> world_place(const LabelImage<Dim>& image, const Vec<Dim>& inner) {
  const Vec<Dim> world = to_world(image.frame, inner);
  Vec<3> place{};
  for (int d = 0; d < Dim; ++d) place[d] = world[d];
  return place;
}

template <int Dim>
void list_broken(const TopologyInput<Dim>& in, std::int32_t background, TopologyReport& report) {
  std::vector<std::uint8_t> in_mesh(in.image.labels.size());  // whether a component of the label survives
  for (std::size_t c = 0; c < in.fates.size(); ++c)
    in_mesh[in.map.components[c].material] |= static_cast<std::uint8_t>(!in.fates[c].lost());
  const std::vector<std::int64_t> largest = largest_components(in.map.components, in.image.labels.size());
  for (std::size_t c = 0; c < in.fates.size(); ++c) {
    const ImageComponent& component = in.map.components[c];
    const std::int32_t label = in.image.labels[component.material];
    if ((!in.fates[c].lost() && !in.fates[c].split()) || label == background) continue;
    const Vec<Dim> centre = in.image.centre(coord_of(component.first_voxel, in.image.extent));
    const auto& most = in.map.components[static_cast<std::size_t>(largest[component.material])];
    const bool last = !in_mesh[component.material] && component.voxels == most.voxels;
    auto& list = component.voxels >= report.min_component || last ? report.broken : report.broken_small;
    list.push_back({label, component.voxels, in.fates[c].lost(), world_place(in.image, centre)});
  }
  for (auto* list : {&report.broken, &report.broken_small})
    std::ranges::stable_sort(*list, {}, [](const BrokenComponent& b) { return std::tuple(!b.lost, -b.voxels); });
}

template <int Dim>
Vec<Dim> corner_point(const LabelImage<Dim>& image, const Coord<Dim>& corner) {
  Vec<Dim> x{};
  for (int d = 0; d < Dim; ++d) x[d] = corner[d] * image.frame.spacing[d];
  return x;
}

/// Contacts of components that meet at pinched corners of the image.
template <int Dim>
void list_contacts(const TopologyInput<Dim>& in, std::span<const ImagePinch> pinches, const Coord<Dim>& corners,
                   std::int32_t background, TopologyReport& report) {
  struct Contact {
    std::uint32_t a, b;
    std::int64_t corner;
    auto operator<=>(const Contact&) const = default;
  };
  std::vector<Contact> contacts;
  for (const ImagePinch& p : pinches) {
    if (in.image.labels[p.material] == background) continue;
    const Coord<Dim> corner = coord_of(p.corner, corners);
    std::vector<std::uint32_t> around;
    for (int v = 0; v < 1 << Dim; ++v) {
      Coord<Dim> voxel = corner;
      bool inside = true;
      for (int d = 0; d < Dim; ++d) {
        voxel[d] += (v >> d & 1) - 1;
        inside &= voxel[d] >= 0 && voxel[d] < in.image.extent[d];
      }
      if (inside && in.image.material(voxel) == p.material)
        around.push_back(in.map.of(linear_index(voxel, in.image.extent)));
    }
    std::ranges::sort(around);
    around.erase(std::unique(around.begin(), around.end()), around.end());
    for (std::size_t i = 0; i < around.size(); ++i)
      for (std::size_t j = i + 1; j < around.size(); ++j) contacts.push_back({around[i], around[j], p.corner});
  }
  std::ranges::sort(contacts);
  const auto same = [](const Contact& x, const Contact& y) { return x.a == y.a && x.b == y.b; };
  contacts.erase(std::unique(contacts.begin(), contacts.end(), same), contacts.end());
  report.contacts = std::ssize(contacts);
  for (const Contact& c : contacts) {
    const ComponentFate &a = in.fates[c.a], &b = in.fates[c.b];
    if (a.lost() || b.lost() || (a.first <= b.last && b.first <= a.last)) continue;
    const ImageComponent &x = in.map.components[c.a], &y = in.map.components[c.b];
    report.separated.push_back({in.image.labels[x.material], std::min(x.voxels, y.voxels),
                                world_place(in.image, corner_point(in.image, coord_of(c.corner, corners)))});
  }
}

/// Whether the voxels of a label are pinched within a box, or less than a voxel from it.
template <int Dim>
bool pinched_near(const LabelImage<Dim>& image, std::span<const ImagePinch> pinches, const Coord<Dim>& corners,
                  MaterialId material, const Vec<Dim>& low, const Vec<Dim>& high) {
  Coord<Dim> begin{}, count{};
  for (int d = 0; d < Dim; ++d) {
    const double h = image.frame.spacing[d];
    begin[d] = std::max(0, static_cast<std::int32_t>(std::ceil(low[d] / h - 1)));
    count[d] = std::min(corners[d] - 1, static_cast<std::int32_t>(std::floor(high[d] / h + 1))) - begin[d] + 1;
    if (count[d] <= 0) return false;
  }
  for (std::int64_t row = 0; row < product(count) / count[0]; ++row) {
    Coord<Dim> c = coord_of(row * count[0], count);
    for (int d = 0; d < Dim; ++d) c[d] += begin[d];
    const std::int64_t first = linear_index(c, corners);
    for (auto p = std::ranges::lower_bound(pinches, first, {}, &ImagePinch::corner);
         p != pinches.end() && p->corner < first + count[0]; ++p)
      if (p->material == material) return true;
  }
  return false;
}

template <int Dim>
void list_pinches(const TopologyInput<Dim>& in, std::span<const ImagePinch> image_pinches, const Coord<Dim>& corners,
                  std::span<const MaterialId> to_image, TopologyReport& report) {
  const std::vector<MeshPinch>& found = in.components.pinches();
  if (found.empty()) return;
  // The boxes of the stars of the pinched vertices.
  std::vector<std::uint32_t> slot(in.mesh.points.size(), 0);
  std::vector<Vec<Dim>> low, high;
  for (const MeshPinch& p : found) {
    if (slot[p.vertex] != 0) continue;
    low.push_back(in.mesh.points[p.vertex]);
    high.push_back(low.back());
    slot[p.vertex] = static_cast<std::uint32_t>(low.size());
  }
  for (const CellBlock& block : in.mesh.blocks) {
    const int n = vertex_count(block.type);
    for (std::int64_t c = 0; c < block.size(); ++c)
      for (int k = 0; k < n; ++k) {
        const std::uint32_t s = slot[block.cell(c)[k]];
        if (s == 0) continue;
        for (int j = 0; j < n; ++j)
          for (int d = 0; d < Dim; ++d) {
            const double x = in.mesh.points[block.cell(c)[j]][d];
            low[s - 1][d] = std::min(low[s - 1][d], x);
            high[s - 1][d] = std::max(high[s - 1][d], x);
          }
      }
  }
  for (const MeshPinch& p : found) {
    const std::uint32_t s = slot[p.vertex] - 1;
    const MaterialId m = to_image[p.material];
    const bool in_image = m != kOutside && pinched_near(in.image, image_pinches, corners, m, low[s], high[s]);
    report.pinches.push_back({in.mesh.labels[p.material], in_image, world_place(in.image, in.mesh.points[p.vertex])});
  }
}

std::string count(std::size_t n, const std::string& what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

}  // namespace

bool TopologyReport::breached() const {
  return !broken.empty() || std::ranges::any_of(pinches, [](const PinchPlace& p) { return !p.in_image; });
}

std::string TopologyReport::breach() const {
  const auto lost = static_cast<std::size_t>(std::ranges::count_if(broken, &BrokenComponent::lost));
  const auto alone = std::ranges::count_if(pinches, [](const PinchPlace& p) { return !p.in_image; });
  std::string text;
  const auto add = [&](std::size_t n, const std::string& what) {
    if (n > 0) text += (text.empty() ? "" : ", ") + count(n, what);
  };
  add(lost, "lost component");
  add(broken.size() - lost, "split component");
  add(static_cast<std::size_t>(alone), "non-manifold place");
  if (!broken.empty())
    text += "; the first is of label " + std::to_string(broken[0].label) + " with " +
            count(static_cast<std::size_t>(broken[0].voxels), "voxel");
  return text;
}

template <int Dim>
TopologyReport report_topology(const TopologyInput<Dim>& in, std::int32_t background, std::int64_t min_component,
                               const Execution& execution) {
  TopologyReport report;
  report.min_component = min_component;
  Coord<Dim> corners = in.image.extent;
  for (auto& c : corners) ++c;
  const std::vector<ImagePinch> pinches = find_image_pinches(in.image, in.uniform, execution);
  report.image_pinches = std::ssize(pinches);
  list_broken(in, background, report);
  list_contacts<Dim>(in, pinches, corners, background, report);
  list_pinches<Dim>(in, pinches, corners, match_labels(in.mesh.labels, in.image.labels), report);
  return report;
}

template TopologyReport report_topology(const TopologyInput<2>&, std::int32_t, std::int64_t, const Execution&);
template TopologyReport report_topology(const TopologyInput<3>&, std::int32_t, std::int64_t, const Execution&);

}  // namespace treemarch
