#include "treemarch/pipeline/preserve_volume.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "treemarch/report/cell_sums.h"

namespace treemarch {
namespace {

constexpr int kRounds = 8;
constexpr double kPromised = 0.005, kWanted = 0.004;  // relative error
constexpr std::int64_t kLeastVoxels = 1000;
constexpr double kMostStep = 0.3, kMost = 0.69;  // of the logarithm of a factor
// A factor 1 + d moves a surface by about 0.6 d voxels where the weights of both sides are 1/2.
constexpr double kVoxelsPerLog = 0.6;
constexpr double kSmoothOverSteps = 0.67;  // area of a smooth surface over that of its voxel faces

}  // namespace

template <int Dim>
VolumeKeeper<Dim>::VolumeKeeper(const LabelImage<Dim>& image, MaterialId left_out)
    : labels_(image.labels.size()), left_out_(left_out) {
  const double voxel = image.voxel_volume();
  std::vector<std::int64_t> voxels(labels_.size());
  for (std::int64_t v = 0; v < image.voxels.size(); ++v) {
    const MaterialId m = image.voxels[v];
    ++voxels[m];
    const Coord<Dim> c = coord_of(v, image.extent);
    std::int64_t stride = 1;
    for (int d = 0; d < Dim; ++d) {
      if (c[d] + 1 < image.extent[d] && image.voxels[v + stride] != m)
        for (const MaterialId side : {m, image.voxels[v + stride]})
          labels_[side].response += kSmoothOverSteps * kVoxelsPerLog * voxel;  // a face times a voxel's side
      stride *= image.extent[d];
    }
  }
  for (std::size_t m = 0; m < labels_.size(); ++m) {
    labels_[m].target = static_cast<double>(voxels[m]) * voxel;
    labels_[m].counts = voxels[m] >= kLeastVoxels && m != left_out;
  }
}

template <int Dim>
std::vector<float> VolumeKeeper<Dim>::scale() const {
  std::vector<float> scale;
  for (const Label& l : labels_) scale.push_back(static_cast<float>(std::exp(l.log_scale)));
  return scale;
}

template <int Dim>
bool VolumeKeeper<Dim>::look(const Mesh<Dim>& mesh, VolumeReport& report, const Execution& execution) {
  const std::vector<double> volume = sum_cells(mesh, execution).volume;
  report.error_after = 0;
  report.labels = report.labels_off = 0;
  for (std::size_t m = 0; m < labels_.size(); ++m) {
    Label& l = labels_[m];
    if (m == left_out_ || l.response == 0) continue;
    const double error = std::abs(volume[m] / l.target - 1);
    if (l.counts) {
      ++report.labels;
      report.labels_off += error > kPromised;
      report.error_after = std::max(report.error_after, error);
    }
    if (report.rounds > 0 && std::abs(l.step) > 1e-3) {
      const double seen = (volume[m] - l.volume) / l.step;
      l.response = std::clamp(seen, 0.5 * l.response, 2 * l.response);
    }
    l.volume = volume[m];
    const double step = std::clamp((l.target - l.volume) / l.response, -kMostStep, kMostStep);
    const double next = std::clamp(l.log_scale + step, -kMost, kMost);
    l.step = next - l.log_scale;
    l.log_scale = next;
  }
  if (report.rounds++ == 0) report.error_before = report.error_after;
  return report.error_after > kWanted && report.rounds < kRounds;
}

template class VolumeKeeper<2>;
template class VolumeKeeper<3>;

}  // namespace treemarch
