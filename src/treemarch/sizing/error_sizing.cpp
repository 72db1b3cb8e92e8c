#include "treemarch/sizing/error_sizing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::uint32_t kNone = 0xffffffffU;
constexpr double kTie = 1e-9;
constexpr double kMargin = 0.25;     // of the side: voxels around a cell that count as well
constexpr std::int64_t kPiece = 8;   // voxels
constexpr double kMostOverMean = 2;  // distance of an interface from a plane that fits it

/// Calls f(coordinates, index) for the points of a box in an array, first axis fastest.
template <int Dim, class F>
void for_points(const VoxelBox<Dim>& box, const Coord<Dim>& extent, F&& f) {
  Coord<Dim> c = box.begin;
  while (true) {
    std::int64_t i = linear_index(c, extent);
    for (c[0] = box.begin[0]; c[0] < box.end[0]; ++c[0], ++i) f(c, i);
    c[0] = box.begin[0];
    int d = 1;
    while (d < Dim && ++c[d] == box.end[d]) {
      c[d] = box.begin[d];
      ++d;
    }
    if (d == Dim) return;
  }
}

/// What linear functions make of the labels in a box of voxels.
template <int Dim>
class LinearLabels {
 public:
  explicit LinearLabels(const LabelImage<Dim>& image) : image_(image), place_(image.labels.size(), kNone) {}

  /// Whether wrong voxels of a box have more than a volume, or there are some and a label that lies wholly within it
  /// has no voxel that is right. A voxel is wrong if another label's function is larger, and if it is not among the
  /// voxels that its own function would take for as many as the label has: the first alone is unfair where labels have
  /// unequal shares, the second where three of them meet.
  bool are_wrong(const VoxelBox<Dim>& box, double most_volume) {
    gather(box);
    bool wrong = false;
    if (labels_.size() > 1) {
      fit(box);
      find_suspects(box);
      // What is found next takes longer, and mends suspects only.
      if (volume(std::ssize(suspects_)) > most_volume || loses_a_piece()) wrong = judge_suspects(box, most_volume);
    }
    for (const Label& l : labels_) place_[l.material] = kNone;
    return wrong;
  }

 private:
  struct Label {
    MaterialId material;
    bool on_rim = false;
    std::int64_t voxels = 0, right = 0, suspects = 0;
    double mean = 0;
    Vec<Dim> slope{};      // until fit(): sum of the places
    double along_row = 0;  // at the begin of a row
  };

  /// Twice the place relative to the middle of the box: a whole number.
  static Vec<Dim> relative(const Coord<Dim>& c, const VoxelBox<Dim>& box) {
    Vec<Dim> x;
    for (int d = 0; d < Dim; ++d) x[d] = 2 * c[d] + 1 - box.begin[d] - box.end[d];
    return x;
  }
  /// Whether the label may go on beyond the box.
  [[nodiscard]] bool is_rim(const Coord<Dim>& c, const VoxelBox<Dim>& box) const {
    for (int d = 0; d < Dim; ++d)
      if ((c[d] == box.begin[d] && c[d] > 0) || (c[d] + 1 == box.end[d] && c[d] + 1 < image_.extent[d])) return true;
    return false;
  }
  /// By runs of one label along the first axis; sums of places are whole numbers, exact in any order.
  void gather(const VoxelBox<Dim>& box) {
    labels_.clear();
    own_.clear();
    image_.voxels.visit([&](const auto* voxels) {
      for_each_row(box, image_.extent, [&](Coord<Dim> c, std::int64_t i) {
        while (c[0] < box.end[0]) {
          std::int32_t end = c[0] + 1;
          while (end < box.end[0] && voxels[i + end - c[0]] == voxels[i]) ++end;
          add_run(voxels[i], c, end, box);
          i += end - c[0];
          c[0] = end;
        }
      });
    });
  }
  /// The voxels from `first` up to but without `end` along the first axis.
  void add_run(MaterialId material, const Coord<Dim>& first, std::int32_t end, const VoxelBox<Dim>& box) {
    std::uint32_t& place = place_[material];
    if (place == kNone) {
      place = static_cast<std::uint32_t>(labels_.size());
      labels_.push_back({.material = material});
    }
    const std::int32_t n = end - first[0];
    own_.insert(own_.end(), static_cast<std::size_t>(n), place);
    Label& label = labels_[place];
    label.voxels += n;
    Vec<Dim> sum = static_cast<double>(n) * relative(first, box);
    sum[0] += static_cast<double>(n) * (n - 1);
    label.slope = label.slope + sum;
    Coord<Dim> last = first;
    last[0] = end - 1;
    label.on_rim = label.on_rim || is_rim(first, box) || is_rim(last, box);
  }
  /// Least squares: places along different axes are uncorrelated over a box.
  void fit(const VoxelBox<Dim>& box) {
    const auto n = static_cast<double>(own_.size());
    for (Label& l : labels_) {
      l.mean = static_cast<double>(l.voxels) / n;
      for (int d = 0; d < Dim; ++d) {
        const double side = box.end[d] - box.begin[d];
        l.slope[d] = side > 1 ? l.slope[d] / (n * (side * side - 1) / 3) : 0;
      }
    }
  }
  [[nodiscard]] double volume(std::int64_t voxels) const { return static_cast<double>(voxels) * image_.voxel_volume(); }
  [[nodiscard]] bool loses_a_piece() const {
    return std::ranges::any_of(labels_, [](const Label& l) { return !l.on_rim && l.right == 0 && l.voxels >= kPiece; });
  }
  /// The voxels where another label's function is larger.
  void find_suspects(const VoxelBox<Dim>& box) {
    suspects_.clear();
    const std::int32_t width = box.end[0] - box.begin[0];
    most_.resize(static_cast<std::size_t>(width));
    auto own = own_.begin();
    for_each_row(box, image_.extent, [&](const Coord<Dim>& c, std::int64_t) {
      // Along a row each function is a value at its begin, and a slope.
      const Vec<Dim> x = relative(c, box);
      std::ranges::fill(most_, -std::numeric_limits<double>::infinity());
      for (Label& l : labels_) {
        l.along_row = dot(l.slope, x);
        const double value = l.mean + l.along_row, step = 2 * l.slope[0];
        double* const most = most_.data();
        for (std::int32_t k = 0; k < width; ++k) most[k] = std::max(most[k], value + k * step);
      }
      for (std::int32_t k = 0; k < width; ++k, ++own) {
        Label& l = labels_[*own];
        const double along = l.along_row + k * (2 * l.slope[0]);
        if (most_[static_cast<std::size_t>(k)] > l.mean + along + kTie)
          suspects_.push_back({*own, along}), ++l.suspects;
        else
          ++l.right;
      }
    });
  }
  /// Labels with many suspects come first, and no more are judged than decide.
  bool judge_suspects(const VoxelBox<Dim>& box, double most_volume) {
    order_.resize(labels_.size());
    std::iota(order_.begin(), order_.end(), 0U);
    std::ranges::sort(order_, [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(-labels_[a].suspects, a) < std::pair(-labels_[b].suspects, b);
    });
    const bool may_lose = loses_a_piece();
    std::int64_t wrong = 0, left = std::ssize(suspects_);
    for (const std::uint32_t place : order_) {
      if (left == 0 || (!may_lose && volume(wrong + left) <= most_volume)) break;
      Label& l = labels_[place];
      left -= l.suspects;
      const double limit = half_space(l, box) - kTie;
      for (const auto& [of, along] : suspects_)
        if (of == place) ++(along >= limit ? l.right : wrong);
      if (volume(wrong) > most_volume) return true;
    }
    return wrong > 0 && loses_a_piece();
  }
  /// The value along the slope of a label above which lie as many voxels of the box as it has. Values are sorted into
  /// bins by their order, of which one holds the wanted one.
  double half_space(const Label& label, const VoxelBox<Dim>& box) {
    constexpr int kBins = 128;
    const std::int32_t width = box.end[0] - box.begin[0];
    const double step = 2 * label.slope[0];
    double most = 0;
    for (int d = 0; d < Dim; ++d) most += std::abs(label.slope[d]) * (box.end[d] - box.begin[d]);
    const double per_bin = most > 0 ? 0.5 * kBins / most : 0;
    const auto bin_of = [&](double along) { return static_cast<int>((most - along) * per_bin) & (kBins - 1); };
    std::array<std::int32_t, kBins> count{};
    along_.resize(own_.size());
    double* to = along_.data();
    for_each_row(box, image_.extent, [&](const Coord<Dim>& c, std::int64_t) {
      const double begin = dot(label.slope, relative(c, box));
      for (std::int32_t k = 0; k < width; ++k, ++to) {
        *to = begin + k * step;
        ++count[static_cast<std::size_t>(bin_of(*to))];
      }
    });
    std::int64_t rank = label.voxels - 1;
    int bin = 0;
    for (; rank >= count[static_cast<std::size_t>(bin)]; ++bin) rank -= count[static_cast<std::size_t>(bin)];
    in_bin_.clear();
    for (const double along : along_)
      if (bin_of(along) == bin) in_bin_.push_back(along);
    const auto at = in_bin_.begin() + rank;
    std::ranges::nth_element(in_bin_, at, std::greater<>());
    return *at;
  }

  const LabelImage<Dim>& image_;
  std::vector<std::uint32_t> place_;  // of each material in labels_
  std::vector<Label> labels_;
  std::vector<std::uint32_t> own_;                          // label of each voxel of the box
  std::vector<std::pair<std::uint32_t, double>> suspects_;  // label and place along its slope
  std::vector<double> most_;                                // largest function along a row
  std::vector<std::uint32_t> order_;                        // of labels_, as they are judged
  std::vector<double> along_, in_bin_;
};

/// The cells of one level.
template <int Dim>
class LevelErrors {
 public:
  LevelErrors(const LabelImage<Dim>& image, const SizedLattice<Dim>& sized, int level)
      : image_(image), side_(sized.pattern.cell_extent(level)), lattice_(sized.lattice.extent), level_(level) {
    for (int d = 0; d < Dim; ++d) {
      cells_[d] = (lattice_[d] + side_[d] - 1) / side_[d];
      voxels_[d] = sized.lattice.unit[d] / image.frame.spacing[d];
    }
  }
  [[nodiscard]] std::int64_t size() const { return product(cells_); }

  void split(std::int64_t index, double tolerance, const UniformBlocks<Dim>& uniform, LinearLabels<Dim>& labels,
             std::vector<std::uint8_t>& levels) const {
    const Coord<Dim> cell = coord_of(index, cells_);
    VoxelBox<Dim> box, around;
    for (int d = 0; d < Dim; ++d) {
      box.begin[d] = cell[d] * side_[d];
      box.end[d] = std::min(lattice_[d], box.begin[d] + side_[d]);
      const auto margin =
          std::max<std::int32_t>(1, static_cast<std::int32_t>(std::lround(kMargin * side_[d] * voxels_[d])));
      const auto voxel_at = [&](std::int32_t at) {
        return static_cast<std::int32_t>(std::ceil(at * voxels_[d] - 0.5));
      };
      around.begin[d] = std::max(0, voxel_at(box.begin[d]) - margin);
      around.end[d] = std::min(image_.extent[d], voxel_at(box.end[d]) + margin);
    }
    if (around.is_empty() || uniform.within(around.begin, around.end) != UniformBlocks<Dim>::kMixed) return;
    std::uint8_t most = 0;
    for_points(box, lattice_, [&](const Coord<Dim>&, std::int64_t i) { most = std::max(most, levels[i]); });
    if (most != level_) return;  // part of a larger leaf, or split anyway
    double volume = 1;
    for (int d = 0; d < Dim; ++d) volume *= (around.end[d] - around.begin[d]) * image_.frame.spacing[d];
    const double area = std::pow(volume, (Dim - 1.0) / Dim);
    if (!labels.are_wrong(around, tolerance * area / kMostOverMean)) return;
    for_points(box, lattice_,
               [&](const Coord<Dim>&, std::int64_t i) { levels[i] = static_cast<std::uint8_t>(level_ + 1); });
  }

 private:
  const LabelImage<Dim>& image_;
  Coord<Dim> side_, lattice_, cells_{};
  int level_;
  Vec<Dim> voxels_{};  // in a finest cell
};

}  // namespace

template <int Dim>
void refine_by_error(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const SizedLattice<Dim>& sized,
                     double tolerance, int last, std::vector<std::uint8_t>& levels, const Execution& execution) {
  for (int level = 0; level < last; ++level) {
    constexpr std::int64_t kFinestPerRange = 4096;  // cells
    const LevelErrors<Dim> errors(image, sized, level);
    const std::int64_t grain = kFinestPerRange / product(sized.pattern.cell_extent(level));
    parallel_for_ranges(execution, errors.size(), grain, [&](std::int64_t begin, std::int64_t end) {
      LinearLabels<Dim> labels(image);
      for (std::int64_t i = begin; i < end; ++i) errors.split(i, tolerance, uniform, labels, levels);
    });
  }
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                   \
  template void refine_by_error(const LabelImage<DIM>&, const UniformBlocks<DIM>&, const SizedLattice<DIM>&, double, \
                                int, std::vector<std::uint8_t>&, const Execution&);
TREEMARCH_INSTANTIATE(1)
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
