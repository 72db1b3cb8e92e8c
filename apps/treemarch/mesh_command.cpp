// treemarch mesh IMAGE -o OUT: the whole way from an image file to a mesh file.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <sstream>

#include "commands.h"
#include "image_options.h"
#include "memory_limit.h"
#include "mesh_options.h"
#include "options.h"
#include "terminal.h"
#include "treemarch/core/scratch_memory.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/output_file.h"
#include "treemarch/mesh/partition.h"
#include "treemarch/mesh/picture.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/write_mesh.h"
#include "treemarch/pipeline/clean_up.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/pipeline/node_sets.h"
#include "treemarch/pipeline/prepare.h"
#include "treemarch/pipeline/sizes.h"
#include "treemarch/report/estimate.h"
#include "treemarch/report/report.h"

namespace treemarch::app {
namespace {

struct MeshCommandOptions {
  std::string image, grey, output, interfaces, picture, report;
  ImageOptions reading;
  PrepareOptions prepare;
  CleanUpOptions clean;
  MeshTextOptions mesh;
  OutputSpace space = OutputSpace::file;
  bool compress = true, force = false, json = false, quiet = false, strict = false;
  int threads = 0;
  MemoryOptions memory;
  bool surface = false;
  int partitions = 0;
  std::vector<std::string> node_sets;
};

/// Refuses places that cannot be written before any work is done.
void check_outputs(const MeshCommandOptions& options) {
  if (options.image.empty()) throw Error(ErrorKind::usage, "IMAGE: is missing; see treemarch mesh --help");
  if (options.output.empty()) throw Error(ErrorKind::usage, "-o: is missing; say where the mesh goes");
  if (options.surface) {
    if (!options.interfaces.empty())
      throw Error(ErrorKind::usage, "--interfaces: are what --surface writes to -o; leave one of them out");
    if (options.partitions > 0) throw Error(ErrorKind::usage, "--partitions: are of cells; leave --surface out");
    if (!options.node_sets.empty())
      throw Error(ErrorKind::usage, "--node-set: is of the volume mesh; leave --surface out");
    check_surface_path(options.output, options.force);
  } else {
    check_mesh_path(options.output, options.force);
  }
  if (options.partitions == 1) throw Error(ErrorKind::usage, "--partitions: give 2 or more");
  if ((options.partitions > 0 || !options.node_sets.empty()) && options.output.ends_with(".mesh"))
    throw Error(ErrorKind::usage, options.output + ": holds no node sets and no partition; choose .vtu, .xdmf or .msh");
  if (!options.interfaces.empty()) check_surface_path(options.interfaces, options.force);
  if (!options.report.empty()) const OutputFile probe(options.report, options.force);
  if (!options.picture.empty()) {
    if (!options.picture.ends_with(".png"))
      throw Error(ErrorKind::usage, options.picture + ": pictures are written as .png; choose that extension");
    const OutputFile probe(options.picture, options.force);
  }
  std::vector<std::string> names{options.output, options.interfaces, options.picture, options.report};
  std::erase(names, "");
  std::ranges::sort(names);
  const auto twice = std::ranges::adjacent_find(names);
  if (twice != names.end()) throw Error(ErrorKind::usage, *twice + ": is to hold two things; give two names");
}

/// What can be had of a mesh of four dimensions.
void check_space_time(const MeshCommandOptions& options) {
  const auto refuse = [](const std::string& option) {
    throw Error(ErrorKind::usage, option + ": cannot be had in four dimensions; see treemarch slice");
  };
  if (!options.output.ends_with(".xdmf"))
    throw Error(ErrorKind::usage,
                options.output + ": a mesh of four dimensions is written as .xdmf; choose that extension");
  if (!options.interfaces.empty()) refuse("--interfaces");
  if (options.surface) refuse("--surface");
  if (!options.picture.empty()) refuse("--picture");
  if (!options.grey.empty()) refuse("--grey");
  if (options.strict) refuse("--strict");
  if (options.mesh.plain.preserve_volume) refuse("--preserve-volume");
}

/// The grey image that places the end of the foreground: the one beside the labels, or that of which labels were made.
template <int Dim>
std::optional<GreyInput<Dim>> load_grey(const MeshCommandOptions& options, Execution& execution) {
  const MeshOptions& plain = options.mesh.plain;
  const bool other_field = plain.field && *plain.field != FieldKind::grey;
  if (!options.grey.empty()) {
    if (!options.reading.threshold)
      throw Error(ErrorKind::usage, "--grey: needs --threshold, the value at the surface");
    if (other_field) throw Error(ErrorKind::usage, "--grey: is used by --field grey only; leave one of them out");
  } else if (!options.reading.threshold || other_field || plain.closed_border) {
    return std::nullopt;
  }
  const std::string& path = options.grey.empty() ? options.image : options.grey;
  AnyGreyImage any = load_grey_image(path, options.reading, execution);
  auto* grey = std::get_if<GreyImage<Dim>>(&any);
  if (!grey) throw Error(ErrorKind::input, path + ": has another dimension than " + options.image);
  return GreyInput<Dim>{crop_image(std::move(*grey), options.prepare.roi), *options.reading.threshold};
}

/// Refuses what will not fit. Meshes of the default size are small: they count where a limit or a large image asks.
template <int Dim>
void require_memory(const MeshCommandOptions& options, const std::optional<MemoryLimit>& limit,
                    const LabelImage<Dim>& image, const MeshOptions& mesh, Execution& execution) {
  constexpr std::int64_t kLargeImage = 100'000'000;  // voxels
  if (mesh.sizes.min_size == 0 && !limit && product(image.extent) < kLargeImage) return;
  SizingRule sizes = complete_sizes(image, mesh, execution);
  if (sizes.tolerance > 0) sizes.min_size = sizes.floor_size;
  const bool grey = !options.grey.empty() || options.reading.threshold;
  const MeshEstimate estimate = estimate_mesh(image, sizes, grey, execution);
  if (!limit) return require_memory(estimate, available_memory_bytes());
  require_disk(estimate, limit->bytes, free_disk_bytes(limit->folder) + reserved_scratch_bytes(), limit->folder);
  if (estimate.memory_bytes > limit->bytes)
    execution.warn("--max-memory: " + describe(estimate, limit->bytes) + "; the rest goes to a file in " +
                   limit->folder);
}

/// The image of sizes, if one is given.
template <int Dim>
std::optional<GreyImage<Dim>> load_sizes(const MeshCommandOptions& options, Execution& execution) {
  const std::string& path = options.mesh.size_image;
  if (path.empty()) return std::nullopt;
  ImageOptions reading;
  reading.spacing = options.reading.spacing;
  AnyGreyImage any = load_grey_image(path, reading, execution);
  if constexpr (Dim < 4)
    if (auto* sizes = std::get_if<GreyImage<Dim>>(&any)) return std::move(*sizes);
  throw Error(ErrorKind::input, path + ": has another dimension than " + options.image);
}

/// Whether what is measured is of use to anyone.
bool is_measured(const MeshCommandOptions& options) {
  return !options.quiet || options.json || options.strict || !options.report.empty();
}

template <int Dim>
Report make_report(const MeshCommandOptions& options, const std::vector<std::pair<std::string, std::string>>& given,
                   const LabelImage<Dim>& image, const MeshResult<Dim>& result, Execution& execution) {
  Report report;
  report.version = version();
  report.image = options.image;
  report.mesh = options.output;
  report.options = given;
  describe_mesh(result.mesh, report);
  report.mesh_seconds = result.seconds;
  report.guarantee = result.guarantee;
  report.shift = result.shift;
  if (is_measured(options)) {
    const Execution::Stage stage(execution, "measure");
    // The unit of time says nothing about shapes: in four dimensions they are those of the inner frame.
    report.quality = measure_quality(result.mesh, Dim < 4 ? image.frame : Frame<Dim>{}, kWorstCells, execution);
    report.fidelity = measure_fidelity(image, result.mesh, options.mesh.plain.background, execution,
                                       options.mesh.plain.min_component, result.borders ? &*result.borders : nullptr);
  }
  return report;
}

/// Partition and node sets, and what the report says about them.
template <int Dim>
MeshExtras make_extras(const MeshCommandOptions& options, const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
                       Report& report, Execution& execution) {
  MeshExtras extras;
  extras.node_sets = find_node_sets(options.node_sets, mesh, output_frame(image.frame, options.space), execution);
  for (const NodeSet& set : extras.node_sets) report.node_sets.emplace_back(set.name, std::ssize(set.vertices));
  if (options.partitions > 0) {
    Partition partition = partition_mesh(mesh, options.partitions, execution);
    const auto [least, most] = std::ranges::minmax_element(partition.cells);
    report.parts = {options.partitions, *least, *most, partition.facets_between, partition.vertices_between};
    extras.cell_part = std::move(partition.cell_part);
    extras.vertex_part = std::move(partition.vertex_part);
  }
  return extras;
}

template <int Dim>
void write_all(const MeshCommandOptions& options, const LabelImage<Dim>& image, const Mesh<Dim>& mesh,
               const MeshExtras& extras, Execution& execution) {
  const WriteOptions write{options.force, options.compress, options.space};
  const Execution::Stage stage(execution, "write");
  if (!options.surface) write_mesh(options.output, mesh, image.frame, write, execution, extras);
  if constexpr (Dim < 4) {
    if (const std::string& path = options.surface ? options.output : options.interfaces; !path.empty()) {
      const auto facets = extract_interfaces(mesh, Hull::include, execution);
      write_interfaces(path, mesh, facets, image.frame, write, execution);
    }
    if (!options.picture.empty()) {
      PictureOptions picture;
      picture.overwrite = options.force;
      picture.background = options.mesh.plain.background;
      write_picture(options.picture, mesh, image.frame, picture, execution);
    }
  }
}

void publish(const MeshCommandOptions& options, const Report& report) {
  if (!options.json && options.report.empty()) {
    if (!options.quiet) std::fputs(to_text(report).c_str(), stdout);
    return;
  }
  const std::string json = to_json(report);
  if (!options.report.empty()) {
    OutputFile file(options.report, options.force);
    file.write(json);
    file.commit();
  }
  if (options.json)
    std::fputs(json.c_str(), stdout);
  else if (!options.quiet)
    std::fputs(to_text(report).c_str(), stdout);
}

void run(const MeshCommandOptions& options, const std::vector<std::pair<std::string, std::string>>& given) {
  check_outputs(options);
  const std::optional<MemoryLimit> limit = memory_limit(options.memory, options.output);
  if (limit) apply(*limit);
  Execution execution(options.threads);
  Terminal terminal(execution, options.quiet);
  ImageOptions reading = options.reading;
  if (!options.grey.empty()) reading.threshold.reset();  // it is that of the grey image
  with_moving_image(options.image, reading, execution, [&]<int Dim>(LabelImage<Dim> read) {
    PrepareOptions prepare = options.prepare;
    prepare.background = options.mesh.plain.background;
    if constexpr (Dim == 4) check_space_time(options);
    check_node_sets(options.node_sets, Dim);
    for (const std::string& path : {options.surface ? options.output : "", options.interfaces})
      if (!path.empty()) check_surface_path(path, options.force, Dim);
    LabelImage<Dim> image = prepare_image(std::move(read), prepare, execution);
    CleanUpOptions clean = options.clean;
    clean.background = prepare.background;
    const CleanUpReport cleaned = clean_up(image, clean, execution);
    const std::optional<GreyImage<Dim>> sizes = load_sizes<Dim>(options, execution);
    const MeshOptions mesh_options = resolve(options.mesh, image, sizes ? &*sizes : nullptr);
    std::optional<GreyInput<Dim>> grey;
    if constexpr (Dim < 4) {
      require_memory(options, limit, image, mesh_options, execution);
      grey = load_grey<Dim>(options, execution);
    }
    const MeshResult<Dim> result = mesh_image(image, mesh_options, execution, grey ? &*grey : nullptr);
    if (result.mesh.cell_count() == 0)
      throw Error(ErrorKind::limits, options.image + ": the mesh has no cells; choose a smaller --min-size");
    Report report = make_report(options, given, image, result, execution);
    if (clean.remove_islands > 0 || clean.fill_holes > 0) report.clean_up = cleaned;
    if (options.strict) require_topology(report, options.image);
    const MeshExtras extras = make_extras(options, image, result.mesh, report, execution);
    write_all(options, image, result.mesh, extras, execution);
    report.seconds = execution.stage_times();
    report.warnings = terminal.warnings();
    report.peak_memory_bytes = peak_memory_bytes();
    report.scratch_bytes = reserved_scratch_bytes();
    publish(options, report);
  });
}

/// The options of a command as text, those that were given and those that have a default.
std::vector<std::pair<std::string, std::string>> option_texts(const CLI::App& command) {
  std::vector<std::pair<std::string, std::string>> texts;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames().empty() || !option->get_configurable()) continue;
    const std::string text =
        option->count() > 0 ? CLI::detail::join(option->results(), " ") : option->get_default_str();
    if (!text.empty()) texts.emplace_back(option->get_lnames().front(), text);
  }
  return texts;
}

/// What --config reads: all options that have a value.
std::string config_text(const CLI::App& command) {
  std::string text = "[" + command.get_name() + "]\n";
  std::istringstream lines(command.config_to_str(true));
  for (std::string line; std::getline(lines, line);)
    if (!line.ends_with("=\"\"")) text += line + "\n";
  return text;
}

void add_output_options(CLI::App& mesh, MeshCommandOptions& o) {
  mesh.add_option("IMAGE", o.image, "Image file or folder of slices")->configurable(false);
  mesh.add_option("-o,--output", o.output, "Mesh file: .vtu, .msh, .mesh or .xdmf")->configurable(false);
  mesh.add_option("--interfaces", o.interfaces,
                  "Also write the facets between labels, with both labels: as -o, or .vtp, .stl, .ply");
  mesh.add_flag("--surface", o.surface, "Write nothing but these facets to -o");
  mesh.add_option("--partitions", o.partitions, "Parts for parallel solvers: array partition of cells and nodes")
      ->check(CLI::NonNegativeNumber);
  add_list(mesh, "--node-set", o.node_sets,
           "NAME=box:X0,Y0,Z0,X1,Y1,Z1, NAME=plane:A,B,C,D[,WIDTH] or NAME=nodes:0,5-9: nodes under a name");
  mesh.add_option("--picture", o.picture, "Also write a picture of the mesh, cut open (.png)");
  mesh.add_option("--report", o.report, "Also write the report as JSON");
  add_space_option(mesh, o.space);
  add_topology_options(mesh, o.mesh.plain.min_component, o.strict);
  mesh.add_flag("--compress,!--no-compress", o.compress, "Compress .vtu and .xdmf files")->default_str("true");
  mesh.add_flag("--force", o.force, "Replace files that exist")->configurable(false);
  mesh.add_flag("--json", o.json, "Print the report as JSON");
  mesh.add_flag("--quiet", o.quiet, "Print nothing but errors; measure nothing unless a report or --strict asks");
  add_threads_option(mesh, o.threads);
  add_memory_options(mesh, o.memory);
}

void add_selection_options(CLI::App& mesh, PrepareOptions& o, CleanUpOptions& clean) {
  add_list(mesh, "--keep", o.keep, "Labels to keep, as 1,4-7,liver; the others become background");
  add_list(mesh, "--drop", o.drop, "Labels that become background");
  add_list(mesh, "--merge", o.merge, "Labels that become one: 2-6=brain, 3,4=3");
  mesh.add_option("--roi", o.roi, "Part of the image in voxels from 0, upper ends excluded: 0:64,0:64,10:20");
  mesh.add_option("--remove-islands", clean.remove_islands,
                  "Give parts of labels with fewer voxels than this to what is around them, but the largest of a label")
      ->check(CLI::NonNegativeNumber);
  mesh.add_option("--fill-holes", clean.fill_holes, "Fill enclosed parts of the background with fewer voxels than this")
      ->check(CLI::NonNegativeNumber);
}

}  // namespace

void add_mesh_command(CLI::App& app, Command& command) {
  const auto options = std::make_shared<MeshCommandOptions>();
  const auto dump = std::make_shared<bool>(false);
  CLI::App* mesh = app.add_subcommand("mesh", "Make a mesh of a label image");
  mesh->fallthrough();  // --config belongs to the program
  mesh->configurable();
  add_output_options(*mesh, *options);
  add_image_options(*mesh, options->reading);
  add_space_time_options(*mesh, options->reading);
  mesh->add_option("--grey", options->grey, "Grey image beside the labels: the foreground ends at its --threshold");
  add_selection_options(*mesh, options->prepare, options->clean);
  add_mesh_options(*mesh, options->mesh);
  mesh->add_flag("--dump-config", *dump, "Print all options as a file for --config and end")->configurable(false);
  mesh->callback([=, &command] {
    command = [=] {
      if (*dump)
        std::fputs(config_text(*mesh).c_str(), stdout);
      else
        run(*options, option_texts(*mesh));
    };
  });
}

}  // namespace treemarch::app
