// Fields of grains.
#include <benchmark/benchmark.h>

#include <random>

#include "grains.h"
#include "treemarch/field/field.h"

namespace treemarch {
namespace {

const LabelImage<3>& image() {
  static const LabelImage<3> made = grains(160);
  return made;
}

Field<3> field_of(FieldKind kind, int threads) {
  Execution execution(threads);
  FieldOptions options;
  options.kind = kind;
  return build_field(image(), options, execution);
}

void build(benchmark::State& state) {
  image();
  std::size_t bytes = 0;
  for (auto _ : state)
    bytes = field_of(static_cast<FieldKind>(state.range(0)), static_cast<int>(state.range(1))).memory();
  state.counters["bytes/voxel"] = static_cast<double>(bytes) / static_cast<double>(product(image().extent));
  state.counters["voxels/s"] = benchmark::Counter(static_cast<double>(state.iterations() * product(image().extent)),
                                                  benchmark::Counter::kIsRate);
}
BENCHMARK(build)
    ->ArgsProduct({{static_cast<int>(FieldKind::linear), static_cast<int>(FieldKind::gauss),
                    static_cast<int>(FieldKind::dgf)},
                   {1, 2}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// Points near interfaces, in the order of the scan as in the cut.
std::vector<Vec<3>> points(const Field<3>& field) {
  std::mt19937 random(1);
  std::vector<Vec<3>> result;
  for (std::int64_t i = 0; i < product(image().extent); ++i) {
    const Coord<3> c = coord_of(i, image().extent);
    if (field.bricks().refs[field.bricks().brick_of(c)] & Bricks<3>::kUniform) continue;
    Vec<3> x{};
    for (int d = 0; d < 3; ++d) x[d] = c[d] + (random() % 1000) * 1e-3;
    result.push_back(x);
  }
  return result;
}

void sample(benchmark::State& state) {
  const auto field = field_of(static_cast<FieldKind>(state.range(0)), 2);
  const auto at = points(field);
  LabelWeight out[16];
  for (auto _ : state)
    for (const auto& x : at) benchmark::DoNotOptimize(field.sample(x, out));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(at.size()));
}
BENCHMARK(sample)
    ->Arg(static_cast<int>(FieldKind::dgf))
    ->Arg(static_cast<int>(FieldKind::bspline3))
    ->Unit(benchmark::kMillisecond);

void difference(benchmark::State& state) {
  const auto field = field_of(FieldKind::dgf, 2);
  const auto at = points(field);
  for (auto _ : state)
    for (const auto& x : at) benchmark::DoNotOptimize(field.difference(x, 0, 1));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(at.size()));
}
BENCHMARK(difference)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace treemarch
