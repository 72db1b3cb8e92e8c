#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "treemarch/report/report.h"

namespace treemarch {
namespace {

constexpr std::size_t kRows = 10;
constexpr std::size_t kListed = 20;

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[240];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

std::string place_text(const Vec<3>& x) { return format("(%.2f, %.2f, %.2f)", x[0], x[1], x[2]); }

/// The first of the entries that a table shows, in the order of `before`.
template <class T, class Wanted, class Before>
std::vector<const T*> worst(const std::vector<T>& all, Wanted&& wanted, Before&& before) {
  std::vector<const T*> list;
  for (const T& x : all)
    if (wanted(x)) list.push_back(&x);
  std::ranges::stable_sort(list, [&](const T* a, const T* b) { return before(*a, *b); });
  if (list.size() > kRows) list.resize(kRows);
  return list;
}

double volume_error(const LabelFidelity& l) { return l.image_volume > 0 ? l.volume / l.image_volume - 1 : 0; }

std::string label_table(const Fidelity& fidelity) {
  const auto rows = worst(
      fidelity.labels, [](const LabelFidelity& l) { return l.voxels > 0 && !(l.is_background && l.cells == 0); },
      [](const LabelFidelity& a, const LabelFidelity& b) { return a.dice < b.dice; });
  std::string text = "\nlabels with the smallest Dice, of " + std::to_string(fidelity.labels.size()) +
                     "\n     label      voxels    volume     error     Dice  components (image)  name\n";
  for (const LabelFidelity* l : rows)
    text += format("%10d  %10lld  %8.4g  %+7.2f %%  %7.4f  %10lld  %6lld  ", l->label,
                   static_cast<long long>(l->voxels), l->volume, 100 * volume_error(*l), l->dice,
                   static_cast<long long>(l->components), static_cast<long long>(l->image_components)) +
            l->name + "\n";
  return text;
}

std::string interface_table(const Fidelity& fidelity) {
  const auto rows = worst(
      fidelity.interfaces, [](const InterfaceFidelity& f) { return f.far_area < f.area; },
      [](const InterfaceFidelity& a, const InterfaceFidelity& b) { return a.max > b.max; });
  if (rows.empty()) return {};
  double area = 0, squares = 0, far = 0;
  for (const InterfaceFidelity& f : fidelity.interfaces) {
    area += f.area - f.far_area;
    squares += (f.area - f.far_area) * f.rms * f.rms;
    far += f.far_area;
  }
  std::string text = format("\ninterfaces furthest from the faces between voxels, of %zu; RMS of all %.4g mm\n",
                            fidelity.interfaces.size(), std::sqrt(squares / area));
  if (far > 0)
    text += format("(%.3g %% of the area joins labels that do not touch in the image)\n", 100 * far / (area + far));
  text += "    labels               area       RMS       max  where\n";
  for (const InterfaceFidelity* f : rows)
    text += format("%10d %10d  %8.4g  %8.4g  %8.4g  ", f->first, f->second, f->area, f->rms, f->max) +
            place_text(f->max_place) + "\n";
  return text;
}

std::string cell_table(const Report& report) {
  std::string text = "\ncells with the smallest angles\n     label       min       max  where\n";
  for (std::size_t i = 0; i < std::min(kRows, report.quality.worst.size()); ++i) {
    const WorstCell& w = report.quality.worst[i];
    text += format("%10d  %8.2f  %8.2f  ", w.label, w.angles.min, w.angles.max) + place_text(w.centre) + "\n";
  }
  return text;
}

std::string broken_lines(const std::vector<BrokenComponent>& broken) {
  std::string text;
  for (std::size_t i = 0; i < std::min(kRows, broken.size()); ++i)
    text += format("  label %d: a component of %lld voxels is %s, ", broken[i].label,
                   static_cast<long long>(broken[i].voxels), broken[i].lost ? "lost" : "in several parts") +
            place_text(broken[i].place) + "\n";
  if (broken.size() > kRows) text += "  and " + std::to_string(broken.size() - kRows) + " more\n";
  return text;
}

std::string topology_line(const TopologyReport& t) {
  std::string text = "\ntopology: ";
  if (t.breached())
    text += t.breach();
  else
    text += format("components of %lld voxels or more are whole, boundaries are manifold",
                   static_cast<long long>(t.min_component));
  if (!t.breached() && !t.pinches.empty())
    text += " but for " + std::to_string(t.pinches.size()) + " places where the image is pinched";
  if (!t.broken_small.empty()) {
    const auto lost = std::ranges::count_if(t.broken_small, &BrokenComponent::lost);
    text += format("; of smaller ones %lld are lost, %lld in parts", static_cast<long long>(lost),
                   static_cast<long long>(std::ssize(t.broken_small) - lost));
  }
  if (!t.separated.empty())
    text += format("; %zu of %lld contacts along edges or at corners are parted", t.separated.size(),
                   static_cast<long long>(t.contacts));
  return text;
}

std::string topology_places(const TopologyReport& t) {
  std::string text = broken_lines(t.broken);
  text += broken_lines(t.broken_small);
  const auto places = worst(
      t.pinches, [](const PinchPlace&) { return true; },
      [](const PinchPlace& a, const PinchPlace& b) { return a.in_image < b.in_image; });
  for (const PinchPlace* p : places)
    text += format("  label %d touches itself%s, ", p->label, p->in_image ? " as in the image" : "") +
            place_text(p->place) + "\n";
  const auto parted = worst(
      t.separated, [](const SeparatedContact&) { return true; },
      [](const SeparatedContact& a, const SeparatedContact& b) { return a.voxels > b.voxels; });
  for (const SeparatedContact* s : parted)
    text += format("  label %d: a component of %lld voxels is parted from another, ", s->label,
                   static_cast<long long>(s->voxels)) +
            place_text(s->place) + "\n";
  return text;
}

std::string clean_up_line(const CleanUpReport& c) {
  std::int64_t components = 0, voxels = 0;
  for (const CleanedLabel& l : c.islands) components += l.components, voxels += l.voxels;
  std::string text = format("\ncleaned: %lld islands of %zu labels (%lld voxels), %lld holes (%lld voxels)",
                            static_cast<long long>(components), c.islands.size(), static_cast<long long>(voxels),
                            static_cast<long long>(c.holes.components), static_cast<long long>(c.holes.voxels));
  for (std::size_t i = 0; i < std::min(kListed, c.islands.size()); ++i)
    text += format("%s %d: %lld", i == 0 ? "; voxels by label" : ",", c.islands[i].label,
                   static_cast<long long>(c.islands[i].voxels));
  return text;
}

std::string fidelity_line(const Fidelity& fidelity) {
  std::string text = format(", mean Dice %.4f", fidelity.mean_dice());
  const auto lost = fidelity.lost_labels();
  text += lost.empty() ? ", none lost" : ", lost:";
  for (std::size_t i = 0; i < std::min(lost.size(), kListed); ++i) text += " " + std::to_string(lost[i]);
  if (lost.size() > kListed) text += " and " + std::to_string(lost.size() - kListed) + " more";
  return text;
}

}  // namespace

std::string to_text(const Report& report, ReportLength length) {
  std::string text = std::to_string(report.points) + " points";
  for (const auto& [type, count] : report.cells) text += ", " + std::to_string(count) + " " + name(type) + " cells";
  if (report.parts)
    text += "\n" + std::to_string(report.parts->count) + " parts of " + std::to_string(report.parts->smallest) +
            " to " + std::to_string(report.parts->largest) + " cells, " + std::to_string(report.parts->facets_between) +
            " facets between them";
  for (const auto& [set, count] : report.node_sets) text += "\nnode set " + set + ": " + std::to_string(count);
  if (report.quality.angles != DegreeRange{})
    text += format(report.dimension == 2 ? "\nangles %.2f to %.2f degrees" : "\ndihedral angles %.2f to %.2f degrees",
                   report.quality.angles.min, report.quality.angles.max);
  for (std::size_t t = 0; t < report.quality.jacobians.size(); ++t)
    if (const JacobianQuality& j = report.quality.jacobians[t]; j.cells > 0)
      text += format("\n%s cells: scaled Jacobian at least %.3f, mean %.3f; Jacobian ratio at least %.3f, mean %.3f",
                     name(static_cast<CellType>(t)), j.min_scaled, j.mean_scaled, j.min_ratio, j.mean_ratio);
  if (report.guarantee && report.guarantee->improve.below_after > 0)
    text += "\n" + std::to_string(report.guarantee->improve.below_after) +
            " elements stay below the quality asked for (" + std::string(name_of(report.guarantee->improve.stopped)) +
            ")";
  if (report.defects) text += "\nvalidity: " + report.defects->describe();
  std::int64_t materials = 0;
  bool compared = false;
  for (const LabelFidelity& l : report.fidelity.labels) {
    materials += l.cells > 0;
    compared |= l.voxels > 0;
  }
  text += "\n";
  text += std::to_string(materials) + " labels";
  if (compared) text += fidelity_line(report.fidelity);
  if (report.fidelity.topology) text += topology_line(*report.fidelity.topology);
  if (report.clean_up) text += clean_up_line(*report.clean_up);
  if (report.mesh_seconds > 0) {
    text += format("\nmeshed in %.2f s, %.2f GB at the peak", report.mesh_seconds,
                   static_cast<double>(report.peak_memory_bytes) / 1e9);
    if (report.scratch_bytes > 0)
      text += format(", %.2f GB on a disk", static_cast<double>(report.scratch_bytes) / 1e9);
  }
  text += "\n";
  if (length == ReportLength::full) {
    if (report.fidelity.topology) text += topology_places(*report.fidelity.topology);
    if (compared) text += label_table(report.fidelity) + interface_table(report.fidelity);
    text += cell_table(report);
  }
  return text;
}

}  // namespace treemarch
