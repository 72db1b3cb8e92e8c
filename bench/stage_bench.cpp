// The stages of the default method, one by one, each with the output of those before it: grains of 160^3 voxels, cells
// of a voxel at interfaces. The argument is the number of threads.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <utility>

#include "grains.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/fit.h"
#include "treemarch/improve/improve.h"
#include "treemarch/march/cut.h"
#include "treemarch/mesh/write_mesh.h"
#include "treemarch/repair/repair_topology.h"
#include "treemarch/report/fidelity.h"
#include "treemarch/sizing/cubic_lattice.h"
#include "treemarch/sizing/sizing.h"
#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch {
namespace {

constexpr double kSmallest = 1, kLargest = 16;

Spacetree<3> make_tree(const LabelImage<3>& image, Execution& execution) {
  SizingRule rule;
  rule.min_size = kSmallest;
  rule.max_size = kLargest;
  const SizedLattice<3> sized = choose_cubic_lattice(image, kSmallest, kLargest);
  return build_spacetree<3>(sized.lattice, sized.pattern, required_levels(image, sized, rule, execution), 1, execution);
}

Mesh<3> make_cut(const SimplexLattice<3>& lattice, const Field<3>& field, const LabelImage<3>& image, CutReport& report,
                 Execution& execution) {
  return cut_lattice(lattice, field, image.labels, {}, report, execution);
}

/// What each stage gets, made once.
struct Inputs {
  Execution execution{0};
  LabelImage<3> image = grains(160);
  Field<3> field = build_field(image, {}, execution);
  Spacetree<3> tree = make_tree(image, execution);
  SimplexLattice<3> lattice = tessellate_body_centred(tree, execution);
  CutReport cut_report;
  Mesh<3> mesh_cut = make_cut(lattice, field, image, cut_report, execution);
  Mesh<3> mesh_repaired = mesh_cut, mesh_improved;

  Inputs() {
    repair_topology(mesh_repaired, image, {}, execution);
    mesh_improved = mesh_repaired;
    improve(mesh_improved, field, image.size(), {}, execution);
  }
};

const Inputs& inputs() {
  static const Inputs made;
  return made;
}

/// Runs a stage on a copy of its input.
template <class Input, class Stage>
void run(benchmark::State& state, const Input& input, Stage&& stage) {
  Execution execution(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    state.PauseTiming();
    Input copy = input;
    state.ResumeTiming();
    stage(copy, execution);
  }
  state.counters["cells/s"] = benchmark::Counter(
      static_cast<double>(state.iterations() * inputs().mesh_improved.cell_count()), benchmark::Counter::kIsRate);
}

void tree(benchmark::State& state) {
  run(state, inputs().image,
      [](const LabelImage<3>& image, Execution& execution) { benchmark::DoNotOptimize(make_tree(image, execution)); });
}
void field(benchmark::State& state) {
  run(state, inputs().image, [](const LabelImage<3>& image, Execution& execution) {
    benchmark::DoNotOptimize(build_field(image, {}, execution));
  });
}
void lattice(benchmark::State& state) {
  run(state, inputs().tree, [](Spacetree<3>& tree_copy, Execution& execution) {
    benchmark::DoNotOptimize(tessellate_body_centred(std::move(tree_copy), execution));
  });
}
void cut(benchmark::State& state) {
  run(state, 0, [](int, Execution& execution) {
    CutReport report;
    benchmark::DoNotOptimize(make_cut(inputs().lattice, inputs().field, inputs().image, report, execution));
  });
}
void topology(benchmark::State& state) {
  RepairOptions options;
  options.uniform_cells = inputs().cut_report.far_cells;
  run(state, inputs().mesh_cut, [&](Mesh<3>& mesh, Execution& execution) {
    benchmark::DoNotOptimize(repair_topology(mesh, inputs().image, options, execution));
  });
}
void improve(benchmark::State& state) {
  ImproveOptions options;
  options.first_cell = inputs().cut_report.far_cells;
  run(state, inputs().mesh_repaired, [&](Mesh<3>& mesh, Execution& execution) {
    benchmark::DoNotOptimize(improve(mesh, inputs().field, inputs().image.size(), options, execution));
  });
}
void fit(benchmark::State& state) {
  run(state, inputs().mesh_improved, [](Mesh<3>& mesh, Execution& execution) {
    benchmark::DoNotOptimize(fit_interfaces(mesh, inputs().field, inputs().image.size(), {}, execution));
  });
}
void measure(benchmark::State& state) {
  run(state, 0, [](int, Execution& execution) {
    benchmark::DoNotOptimize(measure_fidelity(inputs().image, inputs().mesh_improved, 0, execution));
  });
}
void write(benchmark::State& state) {
  const std::string path = (std::filesystem::temp_directory_path() / "treemarch_stage_bench.vtu").string();
  WriteOptions options;
  options.overwrite = true;
  options.compress = state.range(1) != 0;
  run(state, 0, [&](int, Execution& execution) {
    write_mesh(path, inputs().mesh_improved, inputs().image.frame, options, execution);
  });
  std::filesystem::remove(path);
}

void threads(benchmark::internal::Benchmark* stage) {
  stage->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
}
BENCHMARK(tree)->Apply(threads);
BENCHMARK(field)->Apply(threads);
BENCHMARK(lattice)->Apply(threads);
BENCHMARK(cut)->Apply(threads);
BENCHMARK(topology)->Apply(threads);
BENCHMARK(improve)->Apply(threads);
BENCHMARK(fit)->Apply(threads);
BENCHMARK(measure)->Apply(threads);
BENCHMARK(write)
    ->ArgNames({"threads", "compressed"})
    ->ArgsProduct({{1, 2}, {0, 1}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace treemarch
