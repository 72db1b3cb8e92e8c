#include "mesh_options.h"

#include <algorithm>
#include <map>

#include "options.h"
#include "treemarch/pipeline/label_table.h"
#include "treemarch/pipeline/length.h"
#include "treemarch/sizing/places.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch::app {
namespace {

int parse_balance(const std::string& text) {
  if (text == "none") return kUnbalanced;
  std::int32_t balance = 0;
  if (!parse_int32(text, balance) || balance < 1)
    throw Error(ErrorKind::usage, "--balance: '" + text + "' is neither a number from 1 nor none");
  return balance;
}

/// The order of separation: a name, or the labels that come first.
template <int Dim>
void parse_order(const std::string& text, const LabelTable& table, const LabelImage<Dim>& image, MeshOptions& options) {
  static const std::map<std::string, MaterialOrder> names = {{"largest", MaterialOrder::largest},
                                                             {"smallest", MaterialOrder::smallest},
                                                             {"label", MaterialOrder::label},
                                                             {"image", MaterialOrder::image}};
  if (const auto named = names.find(text); named != names.end()) {
    options.order = named->second;
    return;
  }
  for (const auto item : split(text, ',')) {
    std::vector<MaterialId> materials = table.find_set(item, "--order");
    std::ranges::sort(materials, {}, [&](MaterialId m) { return image.labels[m]; });
    for (const MaterialId m : materials) {
      if (std::ranges::count(options.first, m) != 0)
        throw Error(ErrorKind::usage, "--order: label " + std::to_string(image.labels[m]) + " is named twice");
      options.first.push_back(m);
    }
  }
}

void add_size_options(CLI::App& mesh, MeshTextOptions& o) {
  mesh.add_option("--detail", o.detail, "Cells that follow the image: about half a million in 3D, two, eight at most")
      ->check(CLI::IsMember({"coarse", "normal", "fine"}).description(""))
      ->type_name("coarse|normal|fine");
  mesh.add_option("--min-size", o.min_size,
                  "Smallest cells, and those at interfaces: 2mm, 2um, 2vox, a bare number is mm");
  mesh.add_option("--max-size", o.max_size, "Largest cells; default by the method");
  mesh.add_option("--tolerance", o.tolerance,
                  "Cells at interfaces as large as this mean distance from the image allows, down to --min-size");
  mesh.add_option("--layers", o.plain.sizes.layers, "Cells across every layer of a label, down to --min-size");
  mesh.add_option("--grading", o.plain.sizes.grading, "How fast cells may grow: at most this much a unit of length")
      ->capture_default_str();
  add_list(mesh, "--size", o.sizes, "LABEL=S: largest cells in a label");
  add_list(mesh, "--interface", o.interfaces, "A:B=S: size of cells between two labels");
  add_list(mesh, "--region", o.regions, "box:X0,Y0,Z0,X1,Y1,Z1=S or sphere:X,Y,Z,R=S: largest cells there, world mm");
  mesh.add_option("--size-image", o.size_image, "Grey image of largest sizes in mm; 0 asks for nothing");
}

/// What a text says of a part of the world: box:LOW,HIGH=SIZE or sphere:CENTRE,RADIUS=SIZE.
template <int Dim>
SizedPlace<Dim> parse_region(const std::string& text, double voxel) {
  const auto refuse = [&](const std::string& why) { throw Error(ErrorKind::usage, "--region: '" + text + "' " + why); };
  const auto [shape, size] = split_assignment(text, "--region");
  SizedPlace<Dim> place;
  place.size = parse_length(size, voxel, "--region");
  place.is_ball = shape.starts_with("sphere:");
  if (!place.is_ball && !shape.starts_with("box:")) refuse("is neither box:...=SIZE nor sphere:...=SIZE");
  const auto numbers = split(shape.substr(shape.find(':') + 1), ',');
  const std::size_t count = place.is_ball ? Dim + 1 : 2 * Dim;
  std::vector<double> value(count);
  bool good = numbers.size() == count;
  for (std::size_t i = 0; good && i < count; ++i) good = parse_double(numbers[i], value[i]);
  if (!good) refuse("must have " + std::to_string(count) + " numbers in an image of " + std::to_string(Dim) + " axes");
  for (int d = 0; d < Dim; ++d) {
    place.low[d] = value[d];
    if (place.is_ball) continue;
    place.high[d] = value[Dim + d];
    if (place.low[d] > place.high[d]) std::swap(place.low[d], place.high[d]);
  }
  if (place.is_ball) place.radius = value[Dim];
  if (place.is_ball && !(place.radius > 0)) refuse("has no radius greater than 0");
  return place;
}

void add_guaranteed_options(CLI::App& mesh, MeshOptions& o) {
  mesh.add_option("--quality", o.quality, "Improve elements whose angles are below this, in degrees; 0: leave them")
      ->capture_default_str();
  mesh.add_option("--quality-floor", o.quality_floor, "No angle below this after the cut, in degrees")
      ->capture_default_str();
  add_choice<bool>(mesh, "--border", o.closed_border, {{"closed", true}, {"flat", false}},
                   "How materials end at the sides of the image")
      ->default_str("flat");
  mesh.add_flag("--preserve-volume", o.preserve_volume,
                "Give labels of 1,000 voxels or more the volume of their voxels, within 0.5 %; meshes several times");
}

void add_paper_options(CLI::App& mesh, MeshTextOptions& o) {
  add_list(mesh, "--weight", o.weights, "LABEL=W: weight of a label where a cell holds several (default 1)");
  mesh.add_option("--pattern", o.plain.pattern, "Refinement: auto, 2, 3, 2x2x1, or one a level: 3,2,2x2x1")
      ->capture_default_str();
  mesh.add_option("--balance", o.balance, "Largest difference of level between neighbours, or none")
      ->capture_default_str();
  add_choice<FacetRule>(mesh, "--facets", o.plain.facets,
                        {{"midpoint", FacetRule::midpoint}, {"extended", FacetRule::extended}},
                        "Facets with hanging nodes: joined to a new node, or divided between their own")
      ->default_str("midpoint");
  mesh.add_option("--snap", o.plain.snap, "Move vertices onto a surface nearer than this part of an edge, 0 to 0.5");
  mesh.add_option("--order", o.order,
                  "Order in which labels are separated: largest, smallest, label, image, or labels as 3,liver,5-9")
      ->capture_default_str();
  mesh.add_option("--smooth", o.plain.smooth, "Smoothing steps")->check(CLI::NonNegativeNumber);
}

}  // namespace

void add_mesh_options(CLI::App& mesh, MeshTextOptions& o) {
  add_choice<Method>(mesh, "--method", o.plain.method,
                     {{"paper", Method::paper},
                      {"guaranteed", Method::guaranteed},
                      {"nielson-sung", Method::nielson_sung},
                      {"nielson-franke", Method::nielson_franke},
                      {"bonnell", Method::bonnell},
                      {"hege", Method::hege}},
                     "How the image is meshed")
      ->default_str("guaranteed");
  add_choice<Elements>(mesh, "--elements", o.plain.elements,
                       {{"tet", Elements::simplices}, {"hybrid", Elements::hybrid}, {"hex", Elements::boxes}},
                       "Tetrahedra, tetrahedra at surfaces and hexahedra elsewhere, or hexahedra alone")
      ->default_str("tet");
  mesh.add_option("--shift", o.plain.shift,
                  "hex: move vertices onto surfaces by at most this part of a cell, below 0.5");
  add_size_options(mesh, o);
  add_choice<bool>(mesh, "--background", o.plain.keep_background, {{"keep", true}, {"drop", false}},
                   "Whether the background is part of the mesh")
      ->default_str("drop");
  mesh.add_option("--background-label", o.plain.background, "The label that means background")->capture_default_str();
  add_choice<FieldKind>(mesh, "--field", o.plain.field,
                        {{"solid-angle", FieldKind::solid_angle},
                         {"linear", FieldKind::linear},
                         {"bspline3", FieldKind::bspline3},
                         {"gauss", FieldKind::gauss},
                         {"dgf", FieldKind::dgf},
                         {"grey", FieldKind::grey}},
                        "Separating function; default by the method");
  mesh.add_option("--sigma", o.plain.sigma, "Smoothing of the fields gauss, dgf and grey, in voxels")
      ->capture_default_str();
  mesh.option_defaults()->group("Method guaranteed");
  add_guaranteed_options(mesh, o.plain);
  mesh.option_defaults()->group("Method paper");
  add_paper_options(mesh, o);
  mesh.option_defaults()->group("Options");
}

template <int Dim>
MeshOptions resolve(const MeshTextOptions& text, const LabelImage<Dim>& image, const GreyImage<Dim>* sizes) {
  const LabelTable table(image.labels, image.names);
  const double voxel = smallest_spacing(image);
  MeshOptions options = text.plain;
  if (text.min_size) options.sizes.min_size = parse_length(*text.min_size, voxel, "--min-size");
  if (text.max_size) options.sizes.max_size = parse_length(*text.max_size, voxel, "--max-size");
  if (text.tolerance) options.sizes.tolerance = parse_length(*text.tolerance, voxel, "--tolerance");
  if (text.detail) {
    if (text.min_size || text.tolerance || options.method != Method::guaranteed)
      throw Error(ErrorKind::usage, "--detail: chooses sizes; leave out --min-size, --tolerance and other methods");
    options.detail = *text.detail == "coarse" ? Detail::coarse : *text.detail == "fine" ? Detail::fine : Detail::normal;
  }
  for (const std::string& region : text.regions)
    if (add_place(image, parse_region<Dim>(region, voxel), options.sizes.voxel_size) == 0)
      throw Error(ErrorKind::usage,
                  "--region: '" + region + "' holds no voxel; coordinates are those of the image file");
  if (sizes && add_size_image(image, *sizes, options.sizes.voxel_size) == 0)
    throw Error(ErrorKind::usage,
                text.size_image + ": gives no voxel of the image a size; it must lie in the same world");
  for (const std::string& size : text.sizes) {
    const auto [labels, length] = split_assignment(size, "--size");
    const double s = parse_length(length, voxel, "--size");
    options.sizes.material_size.resize(image.labels.size());
    for (const MaterialId m : table.find_set(labels, "--size")) options.sizes.material_size[m] = s;
  }
  for (const std::string& size : text.interfaces) {
    const auto [pair, length] = split_assignment(size, "--interface");
    const auto sides = split(pair, ':');
    if (sides.size() != 2) throw Error(ErrorKind::usage, "--interface: '" + size + "' is not of the form A:B=SIZE");
    options.sizes.interface_size.push_back({table.find(sides[0], "--interface"), table.find(sides[1], "--interface"),
                                            parse_length(length, voxel, "--interface")});
  }
  if (!text.weights.empty()) options.weights.assign(image.labels.size(), 1.0);
  for (const std::string& weight : text.weights) {
    const auto [labels, number] = split_assignment(weight, "--weight");
    double w = 0;
    if (!parse_double(number, w) || w <= 0)
      throw Error(ErrorKind::usage, "--weight: '" + weight + "' has no weight greater than zero");
    for (const MaterialId m : table.find_set(labels, "--weight")) options.weights[m] = w;
  }
  options.balance = parse_balance(text.balance);
  parse_order(text.order, table, image, options);
  if (options.snap && !(*options.snap >= 0 && *options.snap < 0.5))
    throw Error(ErrorKind::usage, "--snap: must be at least 0 and below 0.5");
  return options;
}

template MeshOptions resolve(const MeshTextOptions&, const LabelImage<2>&, const GreyImage<2>*);
template MeshOptions resolve(const MeshTextOptions&, const LabelImage<3>&, const GreyImage<3>*);
template MeshOptions resolve(const MeshTextOptions&, const LabelImage<4>&, const GreyImage<4>*);

}  // namespace treemarch::app
