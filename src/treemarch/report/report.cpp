#include "treemarch/report/report.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

namespace treemarch {
namespace {

using Json = nlohmann::ordered_json;

Json label_json(const LabelFidelity& l) {
  return {{"label", l.label},
          {"name", l.name},
          {"voxels", l.voxels},
          {"cells", l.cells},
          {"volume", l.volume},
          {"image_volume", l.image_volume},
          {"dice", l.dice},
          {"image_components", l.image_components},
          {"components", l.components}};
}

Json quality_json(const Report& report) {
  const MeshQuality& quality = report.quality;
  const bool flat = report.dimension == 2;
  if (quality.angles == DegreeRange{}) return nullptr;
  Json json{{flat ? "min_angle" : "min_dihedral", quality.angles.min},
            {flat ? "max_angle" : "max_dihedral", quality.angles.max},
            {"mean_smallest", quality.mean_smallest},
            {"histogram_smallest", quality.smallest},
            {"histogram_largest", quality.largest},
            {"worst", Json::array()}};
  for (std::size_t t = 0; t < quality.jacobians.size(); ++t) {
    const JacobianQuality& j = quality.jacobians[t];
    if (j.cells == 0) continue;
    json["jacobians"][name(static_cast<CellType>(t))] = {{"min_scaled", j.min_scaled},
                                                         {"mean_scaled", j.mean_scaled},
                                                         {"min_ratio", j.min_ratio},
                                                         {"mean_ratio", j.mean_ratio}};
  }
  for (const WorstCell& w : quality.worst) {
    json["worst"].push_back({{"type", name(w.type)},
                             {"cell", w.cell},
                             {"label", w.label},
                             {"centre", w.centre},
                             {"min", w.angles.min},
                             {"max", w.angles.max}});
  }
  return json;
}

Json defects_json(const MeshDefects& d) {
  return {{"inverted_cells", d.inverted_cells},
          {"overused_facets", d.overused_facets},
          {"folded_facets", d.folded_facets},
          {"unused_points", d.unused_points},
          {"coincident_points", d.coincident_points},
          {"hull_facets", d.hull_facets},
          {"facets_off_the_box", d.facets_off_the_box},
          {"volume", d.volume},
          {"box_volume", d.box_volume}};
}

Json guarantee_json(const GuaranteeReport& g) {
  Json json;
  json["quality_floor"] = g.quality_floor;
  json["cut"] = {{"lattice_simplices", g.cut.lattice_simplices}, {"cut_edges", g.cut.cut_edges},
                 {"triple_points", g.cut.triple_points},         {"inner_points", g.cut.inner_points},
                 {"snapped_vertices", g.cut.snapped_vertices},   {"retreated_points", g.cut.retreated_points},
                 {"retreat_rounds", g.cut.retreat_rounds}};
  json["repair"] = {{"rounds", g.repair.rounds},
                    {"pinches_before", g.repair.pinches_before},
                    {"pinches_after", g.repair.pinches_after},
                    {"restored", g.repair.restored},
                    {"bridged", g.repair.bridged},
                    {"relabelled_cells", g.repair.relabelled_cells}};
  if (g.volume.rounds > 0)
    json["preserve_volume"] = {{"rounds", g.volume.rounds},
                               {"error_before", g.volume.error_before},
                               {"error_after", g.volume.error_after},
                               {"labels", g.volume.labels},
                               {"labels_off", g.volume.labels_off}};
  json["improve"] = {{"stopped", name_of(g.improve.stopped)},
                     {"below_target_before", g.improve.below_before},
                     {"below_target_after", g.improve.below_after},
                     {"worst_before", g.improve.worst_before},
                     {"worst_after", g.improve.worst_after},
                     {"moves", g.improve.moves},
                     {"facet_flips", g.improve.facet_flips},
                     {"edge_removals", g.improve.edge_removals},
                     {"collapses", g.improve.collapses},
                     {"splits", g.improve.splits},
                     {"pulls", g.improve.pulls}};
  json["fit"] = {{"facets", g.fit.facets},
                 {"moves", g.fit.moves},
                 {"rms_before", g.fit.rms_before},
                 {"rms_after", g.fit.rms_after}};
  return json;
}

Json place_json(const Vec<3>& place) { return {place[0], place[1], place[2]}; }

Json interfaces_json(const std::vector<InterfaceFidelity>& interfaces) {
  Json json = Json::array();
  for (const InterfaceFidelity& f : interfaces) {
    Json one{{"first", f.first}, {"second", f.second}, {"area", f.area}};
    if (f.far_area < f.area) one.update({{"rms", f.rms}, {"max", f.max}, {"max_place", place_json(f.max_place)}});
    if (f.far_area > 0) one["far_area"] = f.far_area;
    json.push_back(one);
  }
  return json;
}

Json topology_json(const TopologyReport& t) {
  const auto broken = [](const std::vector<BrokenComponent>& list) {
    Json json = Json::array();
    for (const BrokenComponent& b : list)
      json.push_back({{"label", b.label},
                      {"voxels", b.voxels},
                      {"fate", b.lost ? "lost" : "split"},
                      {"place", place_json(b.place)}});
    return json;
  };
  Json json{{"breach", t.breach()},
            {"min_component", t.min_component},
            {"broken_components", broken(t.broken)},
            {"broken_small_components", broken(t.broken_small)},
            {"contacts", t.contacts},
            {"separated_contacts", Json::array()},
            {"image_pinches", t.image_pinches},
            {"pinches", Json::array()}};
  for (const SeparatedContact& s : t.separated)
    json["separated_contacts"].push_back({{"label", s.label}, {"voxels", s.voxels}, {"place", place_json(s.place)}});
  for (const PinchPlace& p : t.pinches)
    json["pinches"].push_back({{"label", p.label}, {"in_image", p.in_image}, {"place", place_json(p.place)}});
  return json;
}

Json clean_up_json(const CleanUpReport& c) {
  const auto one = [](const CleanedLabel& l) {
    return Json{{"label", l.label}, {"components", l.components}, {"voxels", l.voxels}};
  };
  Json json{{"islands", Json::array()}, {"holes", one(c.holes)}};
  for (const CleanedLabel& l : c.islands) json["islands"].push_back(one(l));
  return json;
}

}  // namespace

const char* version() { return TREEMARCH_VERSION; }

const char* name(CellType type) {
  constexpr const char* kName[] = {"line", "triangle", "quad", "tetrahedron", "pyramid", "hexahedron", "pentatope"};
  return kName[static_cast<int>(type)];
}

std::int64_t peak_memory_bytes() {
  // What getrusage() says includes the memory of the process that started this one, until this one took its place.
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::strtoll(line.c_str() + 6, nullptr, 10) * 1024;
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;  // Linux counts in kilobytes
}

template <int Dim>
void describe_mesh(const Mesh<Dim>& mesh, Report& report) {
  report.dimension = Dim;
  report.points = static_cast<std::int64_t>(mesh.points.size());
  report.cells.clear();
  for (const CellBlock& b : mesh.blocks)
    if (b.size() > 0) report.cells.emplace_back(b.type, b.size());
}

std::string to_json(const Report& report) {
  Json json;
  json["version"] = report.version;
  json["image"] = report.image;
  json["mesh"] = report.mesh;
  json["dimension"] = report.dimension;
  json["options"] = Json::object();
  for (const auto& [option, value] : report.options) json["options"][option] = value;
  json["points"] = report.points;
  json["cells"] = Json::object();
  for (const auto& [type, count] : report.cells) json["cells"][name(type)] = count;
  json["quality"] = quality_json(report);
  json["labels"] = Json::array();
  for (const LabelFidelity& l : report.fidelity.labels) json["labels"].push_back(label_json(l));
  json["lost_labels"] = report.fidelity.lost_labels();
  json["dice_mean"] = report.fidelity.mean_dice();
  json["cells_with_unknown_label"] = report.fidelity.unknown_cells;
  if (report.fidelity.topology) {
    json["interfaces"] = interfaces_json(report.fidelity.interfaces);
    json["topology"] = topology_json(*report.fidelity.topology);
  }
  if (report.clean_up) json["clean_up"] = clean_up_json(*report.clean_up);
  if (report.shift)
    json["shift"] = {{"vertices", report.shift->vertices},
                     {"shifted", report.shift->shifted},
                     {"held_back", report.shift->held_back}};
  if (report.parts)
    json["partition"] = {{"parts", report.parts->count},
                         {"smallest", report.parts->smallest},
                         {"largest", report.parts->largest},
                         {"facets_between", report.parts->facets_between},
                         {"nodes_between", report.parts->vertices_between}};
  for (const auto& [set, count] : report.node_sets) json["node_sets"][set] = count;
  if (report.guarantee) json["guarantee"] = guarantee_json(*report.guarantee);
  if (report.defects) {
    json["valid"] = report.defects->sound();
    json["defects"] = defects_json(*report.defects);
  }
  json["seconds"] = Json::object();
  json["seconds"]["mesh"] = report.mesh_seconds;
  for (const Execution::StageTime& s : report.seconds)
    json["seconds"][s.name] = json["seconds"].value(s.name, 0.0) + s.seconds;  // a stage may run more than once
  json["peak_memory_bytes"] = report.peak_memory_bytes;
  json["scratch_bytes"] = report.scratch_bytes;
  json["warnings"] = report.warnings;
  // Names come from files and may not be valid UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

template void describe_mesh(const Mesh<2>&, Report&);
template void describe_mesh(const Mesh<3>&, Report&);
template void describe_mesh(const Mesh<4>&, Report&);

}  // namespace treemarch
