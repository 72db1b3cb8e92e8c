// treemarch slice MESH --time T -o OUT: what a mesh of space and time is at one moment.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "commands.h"
#include "memory_limit.h"
#include "options.h"
#include "terminal.h"
#include "treemarch/core/error.h"
#include "treemarch/march/slice_mesh.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/move_to_inner.h"
#include "treemarch/mesh/output_file.h"
#include "treemarch/mesh/picture.h"
#include "treemarch/mesh/read_mesh.h"
#include "treemarch/mesh/write_mesh.h"

namespace treemarch::app {
namespace {

struct SliceOptions {
  std::string mesh, output, picture;
  double time = 0;
  std::int32_t background = 0;
  bool force = false;
  MemoryOptions memory;
  int threads = 0;
};

/// The axes of space of an affine of `Dim` + 1 axes, of which time is the last.
template <int Dim>
Frame<Dim> frame_of(const MeshRecord& record) {
  Frame<Dim> frame;
  constexpr std::size_t kSide = std::max(Dim + 1, 3) + 1;
  if (record.affine.size() != kSide * kSide) return frame;
  for (int c = 0; c < Dim; ++c) {
    for (int r = 0; r < Dim; ++r) frame.direction[c][r] = record.affine[r * kSide + c];
    frame.origin[c] = record.affine[c * kSide + kSide - 1];
    frame.spacing[c] = norm(frame.direction[c]);
    frame.direction[c] = (1 / frame.spacing[c]) * frame.direction[c];
  }
  if (!(std::abs(determinant<Dim>(frame.direction)) > 1e-6)) return {};
  frame.space = record.space;
  if (frame.space.ends_with('T')) frame.space.pop_back();
  return frame;
}

template <int Dim>
void slice(const Mesh<Dim>& mesh, const MeshRecord& record, const SliceOptions& options, Execution& execution) {
  if constexpr (Dim == 2) {
    throw Error(ErrorKind::input, options.mesh + ": has two dimensions; give a mesh of space and time");
  } else {
    const auto [first, last] = std::ranges::minmax_element(
        mesh.points, [](const Vec<Dim>& a, const Vec<Dim>& b) { return a[Dim - 1] < b[Dim - 1]; });
    Mesh<Dim - 1> section = slice_mesh(mesh, options.time, execution);
    if (section.cell_count() == 0) {
      char range[80];
      std::snprintf(range, sizeof range, "%.9g to %.9g", (*first)[Dim - 1], (*last)[Dim - 1]);
      throw Error(ErrorKind::usage, "--time: the mesh has nothing there; its times are " + std::string(range));
    }
    const Frame<Dim - 1> frame = frame_of<Dim - 1>(record);
    move_to_inner(section, frame, execution);
    write_mesh(options.output, section, frame, {.overwrite = options.force}, execution);
    if (!options.picture.empty()) {
      PictureOptions picture;
      picture.overwrite = options.force;
      picture.background = options.background;
      write_picture(options.picture, section, frame, picture, execution);
    }
    std::printf("%zu points, %lld cells\n", section.points.size(), static_cast<long long>(section.cell_count()));
  }
}

void run(const SliceOptions& options) {
  if (const auto limit = memory_limit(options.memory, options.output)) apply(*limit);
  Execution execution(options.threads);
  const Terminal terminal(execution, false);
  check_mesh_path(options.output, options.force);
  if (!options.picture.empty()) {
    if (!options.picture.ends_with(".png"))
      throw Error(ErrorKind::usage, options.picture + ": pictures are written as .png; choose that extension");
    const OutputFile probe(options.picture, options.force);
  }
  MeshRecord record;
  const AnyMesh any = read_mesh(options.mesh, execution, &record);
  std::visit([&](const auto& mesh) { slice(mesh, record, options, execution); }, any);
}

}  // namespace

void add_slice_command(CLI::App& app, Command& command) {
  const auto options = std::make_shared<SliceOptions>();
  CLI::App* slice = app.add_subcommand("slice", "What a mesh of space and time is at one moment");
  slice->add_option("MESH", options->mesh, "Mesh whose last axis is time: .xdmf")->required();
  slice->add_option("--time", options->time, "The moment, in the unit of the image")->required();
  slice->add_option("-o,--output", options->output, "Mesh file: .vtu, .msh, .mesh or .xdmf")->required();
  slice->add_option("--picture", options->picture, "Also write a picture of it, cut open (.png)");
  slice->add_option("--background-label", options->background, "The label that the picture leaves out")
      ->capture_default_str();
  slice->add_flag("--force", options->force, "Replace files that exist");
  add_threads_option(*slice, options->threads);
  add_memory_options(*slice, options->memory);
  slice->callback([options, &command] { command = [options] { run(*options); }; });
}

}  // namespace treemarch::app
