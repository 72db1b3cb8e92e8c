// treemarch check MESH [--image IMAGE]: whether a mesh is sound, how good it is, and how true to its image.
#include <cstdio>
#include <memory>
#include <optional>

#include "commands.h"
#include "image_options.h"
#include "memory_limit.h"
#include "options.h"
#include "terminal.h"
#include "treemarch/mesh/move_to_inner.h"
#include "treemarch/mesh/output_frame.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/read_mesh.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/report/report.h"

namespace treemarch::app {
namespace {

struct CheckOptions {
  std::string mesh, image;
  ImageOptions reading;
  MemoryOptions memory;
  OutputSpace space = OutputSpace::file;
  std::int32_t background = 0;
  std::int64_t min_component = 8;
  bool json = false, strict = false;
  int threads = 0;
};

template <int Dim>
Fidelity compare(Mesh<Dim>& mesh, const CheckOptions& options, Execution& execution) {
  std::optional<Fidelity> fidelity;
  with_moving_image(options.image, options.reading, execution, [&]<int ImageDim>(const LabelImage<ImageDim>& image) {
    if constexpr (ImageDim == Dim) {
      move_to_inner(mesh, output_frame(image.frame, options.space), execution);
      fidelity = measure_fidelity(image, mesh, options.background, execution, options.min_component);
    }
  });
  if (!fidelity) throw Error(ErrorKind::input, options.image + ": has another dimension than the mesh " + options.mesh);
  return *fidelity;
}

void run(const CheckOptions& options) {
  if (options.strict && options.image.empty())
    throw Error(ErrorKind::usage, "--strict: needs an image to compare with; give --image");
  if (const auto limit = memory_limit(options.memory, "")) apply(*limit);
  Execution execution(options.threads);
  Terminal terminal(execution, false);
  Report report;
  report.version = version();
  report.image = options.image;
  report.mesh = options.mesh;
  AnyMesh any = read_mesh(options.mesh, execution);
  std::visit(
      [&]<int Dim>(Mesh<Dim>& mesh) {
        describe_mesh(mesh, report);
        report.defects = validate(mesh, execution);
        if (report.defects->bad_cells > 0 || report.defects->unknown_materials > 0)
          throw Error(ErrorKind::input, options.mesh + ": " + report.defects->describe());
        // Shapes in space and time depend on the unit of time: `mesh` measures them, where it is known what a step
        // counts.
        if (Dim < 4) report.quality = measure_quality(mesh, Frame<Dim>{}, kWorstCells, execution);
        report.fidelity = options.image.empty() ? measure_labels(mesh, execution) : compare(mesh, options, execution);
      },
      any);
  report.seconds = execution.stage_times();
  report.peak_memory_bytes = peak_memory_bytes();
  report.scratch_bytes = reserved_scratch_bytes();
  report.warnings = terminal.warnings();
  std::fputs((options.json ? to_json(report) : to_text(report, ReportLength::full)).c_str(), stdout);
  if (!report.defects->sound()) throw Error(ErrorKind::limits, options.mesh + ": " + report.defects->describe());
  if (options.strict) require_topology(report, options.mesh);
}

}  // namespace

void add_check_command(CLI::App& app, Command& command) {
  const auto options = std::make_shared<CheckOptions>();
  CLI::App* check = app.add_subcommand("check", "Whether a mesh is sound, how good it is, and how true to its image");
  check->add_option("MESH", options->mesh, "Mesh file: .vtu, .msh, .mesh or .xdmf")->required();
  check->add_option("--image", options->image, "The label image that the mesh was made from");
  add_image_options(*check, options->reading);
  add_space_time_options(*check, options->reading);
  add_space_option(*check, options->space);
  check->add_option("--background-label", options->background, "The label that may be missing from the mesh")
      ->capture_default_str();
  add_topology_options(*check, options->min_component, options->strict);
  check->add_flag("--json", options->json, "Print JSON");
  add_threads_option(*check, options->threads);
  add_memory_options(*check, options->memory);
  check->callback([options, &command] { command = [options] { run(*options); }; });
}

}  // namespace treemarch::app
