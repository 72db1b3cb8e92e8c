#include "treemarch/field/block_builder.h"

#include <algorithm>
#include <cmath>

namespace treemarch {

namespace {

constexpr std::uint32_t kNone = 0xffffffffU;
/// Labels that weigh less at a voxel are left out.
constexpr std::uint32_t kLeastWeight = VoxelLists<3>::kOne / 512;
/// A voxel whose own label does not win by this much is flagged as perhaps too thin.
constexpr std::uint32_t kThinMargin = VoxelLists<3>::kOne / 10;
/// At most so many other labels a voxel are kept.
constexpr std::size_t kMostOthers = 31;

constexpr std::uint32_t weight_of(std::uint32_t word) { return word & 0xffffU; }
constexpr std::uint32_t make_word(std::uint32_t label, std::uint32_t weight) {
  return (label << 16) | std::min(weight, 0xffffU);
}

/// Keeps the largest entries. All that are equal to the first one dropped go with it, so that the choice does not
/// depend on the numbering of labels.
void keep_largest(std::vector<std::uint32_t>& words, std::size_t most) {
  if (words.size() <= most) return;
  std::vector<std::uint32_t> weights;
  for (std::uint32_t w : words) weights.push_back(weight_of(w));
  std::nth_element(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(most), weights.end(),
                   std::greater<>());
  const std::uint32_t dropped = weights[most];
  std::erase_if(words, [&](std::uint32_t w) { return weight_of(w) <= dropped; });
}

}  // namespace

int IndicatorFilter::radius() const { return none() ? 0 : std::max(first.radius(), second.radius()); }

template <int Dim>
BlockBuilder<Dim>::BlockBuilder(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform,
                                const IndicatorFilter& filter, const GreyRule& grey)
    : image_(image),
      uniform_(uniform),
      filter_(filter),
      grey_(grey),
      halo_(std::max({filter.radius(), filter.band, grey.values != nullptr ? 1 : 0})),
      side_(kSide + 2 * halo_),
      depth_(Dim == 3 ? side_ : 1),
      place_of_(kVoxels),
      local_of_(image.labels.size(), kNone),
      mixed_(kBricks),
      own_(kVoxels),
      own_weight_(kVoxels),
      first_item_(kVoxels + 1),
      line_(side_),
      along_x_(static_cast<std::size_t>(kSide) * side_ * depth_),
      along_y_(static_cast<std::size_t>(kSide) * kSide * depth_),
      value_(kVoxels),
      second_value_(kVoxels),
      left_(kVoxels),
      second_left_(kVoxels),
      foreground_(static_cast<std::size_t>(side_) * depth_) {
  constexpr int kShift = VoxelLists<Dim>::kShift;
  for (int i = 0; i < kVoxels; ++i) {
    Coord<Dim> voxel{};
    int rest = i;
    int brick = 0;
    for (int d = 0; d < Dim; ++d) {
      voxel[d] = rest % kSide;
      rest /= kSide;
    }
    for (int d = Dim; d-- > 0;) brick = brick * kBricksPerSide + (voxel[d] >> kShift);
    place_of_[i] =
        static_cast<std::uint16_t>(brick * VoxelLists<Dim>::kVoxels + VoxelLists<Dim>::place_in_brick(voxel));
  }
}

template <int Dim>
void BlockBuilder<Dim>::add_run(MaterialId material, int x0, int x1, int y, int z) {
  std::uint32_t& local = local_of_[material];
  if (local == kNone) {
    local = static_cast<std::uint32_t>(palette_.size());
    palette_.push_back(material);
  }
  runs_.push_back({local, static_cast<std::int16_t>(x0), static_cast<std::int16_t>(x1), static_cast<std::int16_t>(y),
                   static_cast<std::int16_t>(z)});
}

/// Splits a row of the block and its halo into runs; beyond the image its last voxels go on.
template <int Dim>
template <class T>
void BlockBuilder<Dim>::gather_row(const T* row, std::int32_t first, int y, int z) {
  const std::int32_t begin = std::max(first, 0);
  const std::int32_t end = std::min(first + side_, image_.extent[0]);
  std::int32_t from = first;
  T current = row[begin];
  // Most rows are of one label, which is faster to see as a whole.
  T differs = 0;
  for (std::int32_t x = begin + 1; x < end; ++x) differs = static_cast<T>(differs | (row[x] ^ current));
  for (std::int32_t x = differs == 0 ? end : begin + 1; x < end; ++x) {
    if (row[x] == current) continue;
    add_run(current, from - first, x - first, y, z);
    from = x;
    current = row[x];
  }
  add_run(current, from - first, side_, y, z);
}

template <int Dim>
void BlockBuilder<Dim>::gather_runs(const Coord<Dim>& block) {
  for (MaterialId m : palette_) local_of_[m] = kNone;
  palette_.clear();
  runs_.clear();
  Coord<Dim> first{};
  for (int d = 0; d < Dim; ++d) first[d] = block[d] * kSide - halo_;
  image_.voxels.visit([&](const auto* voxels) {
    for (int z = 0; z < depth_; ++z)
      for (int y = 0; y < side_; ++y) {
        std::int64_t row = std::clamp(first[1] + y, 0, image_.extent[1] - 1);
        if constexpr (Dim == 3)
          row += static_cast<std::int64_t>(std::clamp(first[2] + z, 0, image_.extent[2] - 1)) * image_.extent[1];
        gather_row(voxels + row * image_.extent[0], first[0], y, z);
      }
  });
}

/// A brick is uniform if it and the band around it have one label.
template <int Dim>
bool BlockBuilder<Dim>::find_mixed_bricks() {
  if (palette_.size() == 1) {
    std::fill(mixed_.begin(), mixed_.end(), 0);
    return false;
  }
  constexpr int kBrick = VoxelLists<Dim>::kSide;
  std::vector<std::uint32_t> alone(static_cast<std::size_t>(side_) * depth_ * kBricksPerSide, kNone);
  for (const Run& run : runs_)
    for (int b = 0; b < kBricksPerSide; ++b) {
      const int low = halo_ + b * kBrick - filter_.band;
      if (run.x0 <= low && run.x1 >= low + kBrick + 2 * filter_.band)
        alone[(static_cast<std::size_t>(run.z) * side_ + run.y) * kBricksPerSide + b] = run.label;
    }
  const int window = kBrick + 2 * filter_.band;
  bool any = false;
  for (int brick = 0; brick < kBricks; ++brick) {
    const int b = brick % kBricksPerSide;
    const int y0 = halo_ - filter_.band + brick / kBricksPerSide % kBricksPerSide * kBrick;
    const int z0 = Dim == 3 ? halo_ - filter_.band + brick / (kBricksPerSide * kBricksPerSide) * kBrick : 0;
    const std::uint32_t label = alone[(static_cast<std::size_t>(z0) * side_ + y0) * kBricksPerSide + b];
    bool mixed = label == kNone;
    for (int z = z0; z < z0 + (Dim == 3 ? window : 1) && !mixed; ++z)
      for (int y = y0; y < y0 + window && !mixed; ++y)
        mixed = alone[(static_cast<std::size_t>(z) * side_ + y) * kBricksPerSide + b] != label;
    mixed_[brick] = mixed;
    if (!mixed) continue;
    const int y = brick / kBricksPerSide % kBricksPerSide * kBrick;
    const int z = Dim == 3 ? brick / (kBricksPerSide * kBricksPerSide) * kBrick : 0;
    rows_.y0 = any ? std::min(rows_.y0, y) : y;
    rows_.y1 = any ? std::max(rows_.y1, y + kBrick) : y + kBrick;
    rows_.z0 = any ? std::min(rows_.z0, z) : z;
    rows_.z1 = any ? std::max(rows_.z1, z + (Dim == 3 ? kBrick : 1)) : z + (Dim == 3 ? kBrick : 1);
    any = true;
  }
  return any;
}

/// Counting sort by label; within a label the order of the rows stays.
template <int Dim>
void BlockBuilder<Dim>::sort_runs() {
  first_run_.assign(palette_.size() + 1, 0);
  for (const Run& run : runs_) ++first_run_[run.label + 1];
  for (std::size_t l = 1; l < first_run_.size(); ++l) first_run_[l] += first_run_[l - 1];
  std::vector<Run> sorted(runs_.size());
  std::vector<std::uint32_t> next(first_run_.begin(), first_run_.end() - 1);
  for (const Run& run : runs_) sorted[next[run.label]++] = run;
  runs_.swap(sorted);
}

template <int Dim>
void BlockBuilder<Dim>::fill_own() {
  const int halo_z = Dim == 3 ? halo_ : 0;
  for (const Run& run : runs_) {
    const int y = run.y - halo_;
    const int z = run.z - halo_z;
    if (y < 0 || y >= kSide || z < 0 || z >= kDepth) continue;
    const std::uint16_t* place = place_of_.data() + (z * kSide + y) * kSide;
    for (int x = std::max(run.x0 - halo_, 0); x < std::min(run.x1 - halo_, kSide); ++x) own_[place[x]] = run.label;
  }
  std::fill(own_weight_.begin(), own_weight_.end(), filter_.none() ? VoxelLists<Dim>::kOne : 0);
}

/// The rows of mixed bricks that are within r of a label's runs.
template <int Dim>
typename BlockBuilder<Dim>::Rows BlockBuilder<Dim>::rows_near(const Run* first, const Run* last, int r) const {
  int y0 = side_;
  int y1 = 0;
  for (const Run* run = first; run != last; ++run) {
    y0 = std::min<int>(y0, run->y);
    y1 = std::max<int>(y1, run->y);
  }
  Rows rows{std::max(rows_.y0, y0 - halo_ - r), std::min(rows_.y1, y1 - halo_ + r + 1), 0, 1};
  if (Dim == 3) {
    rows.z0 = std::max(rows_.z0, first->z - halo_ - r);
    rows.z1 = std::min(rows_.z1, (last - 1)->z - halo_ + r + 1);
  }
  return rows;
}

/// Convolves the indicator that the runs describe, along each axis in turn. Rows and planes without a voxel of the
/// label are left zero between calls.
template <int Dim>
void BlockBuilder<Dim>::smooth(const Kernel& kernel, const Run* first, const Run* last, std::vector<float>& out) {
  const int r = kernel.radius();
  const Rows rows = rows_near(first, last, r);
  if (rows.is_empty()) return;
  const int halo_z = Dim == 3 ? halo_ : 0;
  const int reach_z = Dim == 3 ? r : 0;
  const int z0 = std::max<int>(first->z, rows.z0 + halo_z - reach_z);
  const int z1 = std::min<int>((last - 1)->z, rows.z1 + halo_z + reach_z - 1);
  for (const Run* run = first; run != last;) {
    const int y = run->y;
    const int z = run->z;
    if (z < z0 || z > z1 || y < rows.y0 + halo_ - r || y >= rows.y1 + halo_ + r) {
      ++run;
      continue;
    }
    std::fill(line_.begin(), line_.end(), 0.0F);
    for (; run != last && run->y == y && run->z == z; ++run)
      std::fill(line_.begin() + run->x0, line_.begin() + run->x1, 1.0F);
    convolve(line_.data() + halo_, &along_x_[(static_cast<std::size_t>(z) * side_ + y) * kSide], kSide, 1, kernel);
  }
  constexpr int kPlane = kSide * kSide;
  const int n = (rows.y1 - rows.y0) * kSide;
  float* target = Dim == 3 ? along_y_.data() : out.data();
  for (int z = z0; z <= z1; ++z)
    convolve(&along_x_[(static_cast<std::size_t>(z) * side_ + rows.y0 + halo_) * kSide],
             target + z * kPlane + rows.y0 * kSide, n, kSide, kernel);
  if constexpr (Dim == 3) {
    for (int z = rows.z0; z < rows.z1; ++z)
      convolve(&along_y_[static_cast<std::size_t>(z + halo_) * kPlane + rows.y0 * kSide],
               &out[z * kPlane + rows.y0 * kSide], n, kPlane, kernel);
    for (int z = z0; z <= z1; ++z)
      std::fill_n(along_y_.begin() + static_cast<std::ptrdiff_t>(z) * kPlane + rows.y0 * kSide, n, 0.0F);
  }
}

template <int Dim>
void BlockBuilder<Dim>::smooth_label(std::uint32_t label) {
  const Run* first = runs_.data() + first_run_[label];
  const Run* last = runs_.data() + first_run_[label + 1];
  const Rows rows = rows_near(first, last, filter_.radius());
  if (rows.is_empty()) return;
  // The two kernels reach differently far: what only one of them fills must be zero for the other.
  for_rows(rows, [&](int begin, int n) {
    std::fill_n(value_.begin() + begin, n, 0.0F);
    std::fill_n(second_value_.begin() + begin, n, 0.0F);
  });
  smooth(filter_.first, first, last, value_);
  if (!filter_.second.tap.empty()) smooth(filter_.second, first, last, second_value_);
  for (const Run* run = first; run != last; ++run)
    std::fill_n(along_x_.begin() + (static_cast<std::ptrdiff_t>(run->z) * side_ + run->y) * kSide, kSide, 0.0F);
  for_rows(rows, [&](int begin, int n) {
    for (int i = begin; i < begin + n; ++i) {
      left_[i] -= value_[i];
      second_left_[i] -= second_value_[i];
    }
  });
  collect(label, rows);
}

/// Smooths all labels but the one with the most runs: the indicators add up to one, and so do their smoothed values,
/// which are whole numbers.
template <int Dim>
void BlockBuilder<Dim>::smooth_labels() {
  constexpr float kAll = 1U << 24;
  for_rows(rows_, [&](int begin, int n) {
    std::fill_n(left_.begin() + begin, n, kAll);
    std::fill_n(second_left_.begin() + begin, n, filter_.second.tap.empty() ? 0.0F : kAll);
  });
  const auto runs = [&](std::uint32_t l) { return first_run_[l + 1] - first_run_[l]; };
  std::uint32_t largest = 0;
  for (std::uint32_t l = 1; l < palette_.size(); ++l)
    if (runs(l) > runs(largest)) largest = l;
  for (std::uint32_t l = 0; l < palette_.size(); ++l)
    if (l != largest) smooth_label(l);
  for_rows(rows_, [&](int begin, int n) {
    std::copy_n(left_.begin() + begin, n, value_.begin() + begin);
    std::copy_n(second_left_.begin() + begin, n, second_value_.begin() + begin);
  });
  collect(largest, rows_);
}

/// Turns the dense values of a label into entries of the voxels of mixed lists.
template <int Dim>
void BlockBuilder<Dim>::collect(std::uint32_t label, const Rows& rows) {
  constexpr float kToUnit = static_cast<float>(VoxelLists<Dim>::kOne) / (1U << 24);
  for_rows(rows, [&](int begin, int n) {
    for (int i = begin; i < begin + n; ++i)
      value_[i] = std::clamp((filter_.scale * value_[i] - second_value_[i]) * kToUnit + 0.5F, 0.0F, 65535.0F);
    for (int i = begin; i < begin + n; ++i) {
      const auto weight = static_cast<std::uint32_t>(value_[i]);
      const std::uint16_t place = place_of_[i];
      if (own_[place] == label)
        own_weight_[place] = weight;
      else if (weight >= kLeastWeight && mixed_[place / VoxelLists<Dim>::kVoxels])
        items_.push_back({make_word(label, weight), place});
    }
  });
}

/// Counting sort by place; within a place the order of the labels stays.
template <int Dim>
void BlockBuilder<Dim>::sort_items() {
  std::fill(first_item_.begin(), first_item_.end(), 0);
  for (const Item& item : items_) ++first_item_[item.place + 1];
  for (int p = 0; p < kVoxels; ++p) first_item_[p + 1] += first_item_[p];
  words_.resize(items_.size());
  std::vector<std::uint32_t> next(first_item_.begin(), first_item_.end() - 1);
  for (const Item& item : items_) words_[next[item.place]++] = item.word;
}

/// Whether both foreground and background are among a voxel and its neighbours (over faces, edges and corners).
template <int Dim>
bool BlockBuilder<Dim>::near_border_of_foreground(int x, int y, int z) const {
  const std::uint64_t window = std::uint64_t{7} << (x - 1);
  bool any = false;
  bool all = true;
  for (int dz = Dim == 3 ? -1 : 0; dz <= (Dim == 3 ? 1 : 0); ++dz)
    for (int dy = -1; dy <= 1; ++dy) {
      const std::uint64_t bits = foreground_[static_cast<std::size_t>(z + dz) * side_ + y + dy] & window;
      any |= bits != 0;
      all &= bits == window;
    }
  return any && !all;
}

/// Scales the weights of the foreground so that its largest meets the background's where the grey value meets the
/// threshold.
template <int Dim>
void BlockBuilder<Dim>::mix_grey(const Coord<Dim>& voxel, std::vector<std::uint32_t>& entries) {
  std::uint32_t largest = 0;
  const std::uint32_t background = local_of_[grey_.background];
  bool has_background = false;
  for (std::uint32_t word : entries) {
    if (word >> 16 == background)
      has_background = true;
    else
      largest = std::max(largest, weight_of(word));
  }
  const double value = grey_.values[linear_index(voxel, image_.extent)];
  if (largest == 0 || !std::isfinite(value)) return;  // the labels decide
  const double share = std::clamp(0.5 + grey_.slope * (value - grey_.threshold), 0.0, 1.0);
  const auto rest = static_cast<std::uint32_t>(std::lround((1 - share) * VoxelLists<Dim>::kOne));
  for (std::uint32_t& word : entries) {
    const double scaled = share * VoxelLists<Dim>::kOne * weight_of(word) / largest;
    word = make_word(word >> 16, word >> 16 == background ? rest : static_cast<std::uint32_t>(std::lround(scaled)));
  }
  if (!has_background && rest > 0) entries.push_back(make_word(background, rest));
}

/// Lists the entries of a voxel, its own label first; returns whether that does not win by a margin.
template <int Dim>
bool BlockBuilder<Dim>::list_voxel(const Coord<Dim>& voxel, const Coord<Dim>& block, int place) {
  entries_.assign(words_.begin() + first_item_[place], words_.begin() + first_item_[place + 1]);
  keep_largest(entries_, kMostOthers);
  entries_.insert(entries_.begin(), make_word(own_[place], own_weight_[place]));
  std::uint32_t margin = kThinMargin;
  if (grey_.values != nullptr) {
    Coord<Dim> local{};
    for (int d = 0; d < Dim; ++d) local[d] = voxel[d] - block[d] * kSide + halo_;
    if (near_border_of_foreground(local[0], local[1], Dim == 3 ? local[Dim - 1] : 0)) {
      mix_grey(voxel, entries_);
      margin = 1;
    }
  }
  std::uint32_t best = 0;
  for (std::size_t i = 1; i < entries_.size(); ++i) best = std::max(best, weight_of(entries_[i]));
  return weight_of(entries_[0]) < best + margin;
}

/// Lists the entries of all voxels of a brick in lists_ and list_end_; returns the flags of its voxels.
template <int Dim>
std::uint64_t BlockBuilder<Dim>::list_brick(const Coord<Dim>& brick, const Coord<Dim>& block, int first_place) {
  std::uint64_t flags = 0;
  lists_.clear();
  for (int p = 0; p < VoxelLists<Dim>::kVoxels; ++p) {
    Coord<Dim> voxel{};
    bool inside = true;
    for (int d = 0; d < Dim; ++d) {
      voxel[d] =
          brick[d] * VoxelLists<Dim>::kSide + (p >> (d * VoxelLists<Dim>::kShift) & (VoxelLists<Dim>::kSide - 1));
      inside &= voxel[d] < image_.extent[d];
    }
    if (inside) {
      if (list_voxel(voxel, block, first_place + p)) flags |= std::uint64_t{1} << p;
      lists_.insert(lists_.end(), entries_.begin(), entries_.end());
    }
    list_end_[p] = static_cast<std::uint32_t>(lists_.size());
  }
  return flags;
}

/// Appends the brick that list_brick() listed to the chunk; returns its reference.
template <int Dim>
std::uint64_t BlockBuilder<Dim>::append_brick(std::uint32_t chunk_id, std::vector<std::uint32_t>& chunk) const {
  const std::size_t header = chunk.size();
  chunk.resize(header + VoxelLists<Dim>::kHeader);
  // Offsets are 16 bits: 64 voxels of at most 33 entries.
  for (int p = 1; p <= VoxelLists<Dim>::kVoxels; ++p) chunk[header + p / 2] |= list_end_[p - 1] << (16 * (p % 2));
  chunk.insert(chunk.end(), lists_.begin(), lists_.end());
  return (std::uint64_t{chunk_id} << 32) | header;
}

template <int Dim>
void BlockBuilder<Dim>::write_bricks(const Coord<Dim>& block, std::uint32_t chunk_id, VoxelLists<Dim>& lists,
                                     std::uint64_t* flagged) {
  std::vector<std::uint32_t> chunk(palette_.begin(), palette_.end());
  const std::size_t empty = chunk.size();
  for (int b = 0; b < kBricks; ++b) {
    Coord<Dim> brick{};
    bool inside = true;
    for (int d = 0, rest = b; d < Dim; ++d, rest /= kBricksPerSide) {
      brick[d] = block[d] * kBricksPerSide + rest % kBricksPerSide;
      inside &= brick[d] < lists.brick_extent[d];
    }
    if (!inside) continue;
    const std::int64_t index = linear_index(brick, lists.brick_extent);
    const int first_place = b * VoxelLists<Dim>::kVoxels;
    if (!mixed_[b]) {
      lists.refs[index] = VoxelLists<Dim>::kUniform | palette_[own_[first_place]];
      continue;
    }
    const std::uint64_t flags = list_brick(brick, block, first_place);
    lists.refs[index] = append_brick(chunk_id, chunk);
    if (flagged != nullptr) flagged[index] = flags;
  }
  if (chunk.size() > empty) lists.chunks[chunk_id].assign(chunk.begin(), chunk.end());
}

/// Writes the bricks of a block that is of one label, with the band around it.
template <int Dim>
bool BlockBuilder<Dim>::write_uniform(const Coord<Dim>& block, VoxelLists<Dim>& lists) const {
  Coord<Dim> first, last;
  VoxelBox<Dim> bricks;
  for (int d = 0; d < Dim; ++d) {
    first[d] = block[d] * kSide - filter_.band;
    last[d] = (block[d] + 1) * kSide - 1 + filter_.band;
    bricks.begin[d] = block[d] * kBricksPerSide;
    bricks.end[d] = std::min(bricks.begin[d] + kBricksPerSide, lists.brick_extent[d]);
  }
  const MaterialId material = uniform_.within(first, last);
  if (material == UniformBlocks<Dim>::kMixed) return false;
  for_each_row(bricks, lists.brick_extent, [&](const Coord<Dim>&, std::int64_t at) {
    std::fill_n(lists.refs.begin() + at, bricks.end[0] - bricks.begin[0], VoxelLists<Dim>::kUniform | material);
  });
  return true;
}

template <int Dim>
void BlockBuilder<Dim>::build(const Coord<Dim>& block, std::uint32_t chunk_id, VoxelLists<Dim>& lists,
                              std::uint64_t* flagged) {
  if (write_uniform(block, lists)) return;
  gather_runs(block);
  const bool any_mixed = find_mixed_bricks();
  fill_own();
  items_.clear();
  if (any_mixed && !filter_.none()) {
    if (grey_.values != nullptr) {
      std::fill(foreground_.begin(), foreground_.end(), 0);
      for (const Run& run : runs_)
        if (palette_[run.label] != grey_.background)
          foreground_[static_cast<std::size_t>(run.z) * side_ + run.y] |= ((std::uint64_t{1} << (run.x1 - run.x0)) - 1)
                                                                          << run.x0;
    }
    sort_runs();
    smooth_labels();
  }
  if (any_mixed) sort_items();
  if (!any_mixed) first_item_.assign(kVoxels + 1, 0);
  write_bricks(block, chunk_id, lists, flagged);
}

template class BlockBuilder<2>;
template class BlockBuilder<3>;

}  // namespace treemarch
