#include "treemarch/image/label_encoder.h"

#include <algorithm>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = std::int64_t{1} << 18;
/// Up to this many possible values a table maps values to materials; beyond, a sorted array does.
constexpr std::int64_t kLargestTable = std::int64_t{1} << 16;

/// \pre v fits. Promoted first: a char is a number here.
template <class T>
constexpr std::int32_t label_of(T v) {
  return static_cast<std::int32_t>(+v);
}

template <class T>
struct BlockSummary {
  T smallest{}, largest{};
  std::int64_t changes = 0;
};

/// Range and changes of values[begin, end).
template <class T>
BlockSummary<T> summarize(std::span<const T> values, std::int64_t begin, std::int64_t end) {
  const T* v = values.data();
  BlockSummary<T> s{v[begin], v[begin], 0};
  for (std::int64_t i = begin; i < end; ++i) {
    s.smallest = std::min(s.smallest, v[i]);
    s.largest = std::max(s.largest, v[i]);
  }
  for (std::int64_t i = std::max<std::int64_t>(begin, 1); i < end; ++i) s.changes += v[i] != v[i - 1] ? 1 : 0;
  return s;
}

/// Distinct values of a block by first appearance, where they span a small range.
template <class T>
std::vector<std::int32_t> distinct_by_table(std::span<const T> values, std::int64_t smallest, std::size_t range) {
  std::vector<std::uint8_t> seen(range, 0);
  std::vector<std::int32_t> distinct;
  for (const T v : values) {
    std::uint8_t& flag = seen[static_cast<std::size_t>(static_cast<std::int64_t>(v) - smallest)];
    if (!flag) {
      flag = 1;
      distinct.push_back(label_of(v));
    }
  }
  return distinct;
}

/// The first of each value, in the order of their positions. `entries` holds (value, position) pairs.
std::vector<std::int32_t> firsts(std::vector<std::pair<std::int32_t, std::int64_t>> entries) {
  std::sort(entries.begin(), entries.end());
  const auto same_value = [](const auto& a, const auto& b) { return a.first == b.first; };
  entries.erase(std::unique(entries.begin(), entries.end(), same_value), entries.end());
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<std::int32_t> result;
  result.reserve(entries.size());
  for (const auto& e : entries) result.push_back(e.first);
  return result;
}

/// The same for any range.
template <class T>
std::vector<std::int32_t> distinct_by_sorting(std::span<const T> values) {
  std::vector<std::pair<std::int32_t, std::int64_t>> runs;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i == 0 || values[i] != values[i - 1]) runs.emplace_back(label_of(values[i]), static_cast<std::int64_t>(i));
  return firsts(std::move(runs));
}

/// Material of each value within a range: a table over it, or sorted values.
class MaterialLookup {
 public:
  /// \param known labels and their materials, ascending; outlive the object
  MaterialLookup(std::span<const std::pair<std::int32_t, MaterialId>> known, std::int64_t smallest, std::int64_t range)
      : known_(known), smallest_(smallest) {
    if (range > kLargestTable) return;
    table_.resize(static_cast<std::size_t>(range));
    for (const auto& [label, material] : known)
      if (label >= smallest && label - smallest < range) table_[static_cast<std::size_t>(label - smallest)] = material;
  }

  template <class T, class Out>
  void fill(std::span<const T> values, Out* out) const {
    if (!table_.empty()) {
      for (std::size_t i = 0; i < values.size(); ++i)
        out[i] = static_cast<Out>(table_[static_cast<std::size_t>(static_cast<std::int64_t>(values[i]) - smallest_)]);
      return;
    }
    MaterialId last = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (i == 0 || values[i] != values[i - 1]) {
        const auto label = label_of(values[i]);
        last = std::lower_bound(known_.begin(), known_.end(), std::pair<std::int32_t, MaterialId>(label, 0))->second;
      }
      out[i] = static_cast<Out>(last);
    }
  }

 private:
  std::span<const std::pair<std::int32_t, MaterialId>> known_;
  std::int64_t smallest_;
  std::vector<MaterialId> table_;
};

}  // namespace

/// \param distinct by first appearance
void LabelEncoder::add_labels(const std::vector<std::int32_t>& distinct) {
  const auto before = static_cast<std::ptrdiff_t>(known_.size());
  for (const std::int32_t label : distinct) {
    const auto end = known_.begin() + before;
    const auto at = std::lower_bound(known_.begin(), end, std::pair<std::int32_t, MaterialId>(label, 0));
    if (at != end && at->first == label) continue;
    known_.emplace_back(label, static_cast<MaterialId>(result_.labels.size()));
    result_.labels.push_back(label);
  }
  std::sort(known_.begin() + before, known_.end());
  std::inplace_merge(known_.begin(), known_.begin() + before, known_.end());
}

/// For the materials of so many more values; they may need a larger width than those before.
void LabelEncoder::make_room(std::int64_t more) {
  CompactArray& voxels = result_.voxels;
  const std::int64_t done = voxels.size();
  CompactArray wider(0, result_.labels.size());
  if (done == 0 || wider.width() > voxels.width()) {
    wider.reserve(size_);
    wider.resize(done);
    parallel_for(execution_, done, kBlock, [&](std::int64_t i) { wider.set(i, voxels[i]); });
    voxels = std::move(wider);
  }
  voxels.resize(done + more);
}

template <class T>
void LabelEncoder::add(std::span<const T> values) {
  const auto n = static_cast<std::int64_t>(values.size());
  if (n == 0) return;
  const std::int64_t done = result_.voxels.size();
  const auto whole = parallel_reduce(
      execution_, n, kBlock, BlockSummary<T>{values[0], values[0], 0},
      [&](std::int64_t begin, std::int64_t end) { return summarize(values, begin, end); },
      [](const BlockSummary<T>& a, const BlockSummary<T>& b) {
        return BlockSummary<T>{std::min(a.smallest, b.smallest), std::max(a.largest, b.largest), a.changes + b.changes};
      });
  result_.changes += whole.changes + (done > 0 && label_of(values[0]) != last_ ? 1 : 0);
  last_ = label_of(values.back());
  const std::int64_t smallest = label_of(whole.smallest);
  const std::int64_t range = label_of(whole.largest) - smallest + 1;

  // First appearance in the whole is first appearance in the earliest block that has the value.
  std::vector<std::vector<std::int32_t>> distinct(static_cast<std::size_t>(block_count(n, kBlock)));
  const auto block = [&](std::int64_t b) {
    return values.subspan(static_cast<std::size_t>(b * kBlock),
                          static_cast<std::size_t>(std::min(kBlock, n - b * kBlock)));
  };
  parallel_for(execution_, static_cast<std::int64_t>(distinct.size()), 1, [&](std::int64_t b) {
    distinct[static_cast<std::size_t>(b)] = range <= kLargestTable
                                                ? distinct_by_table(block(b), smallest, static_cast<std::size_t>(range))
                                                : distinct_by_sorting(block(b));
  });
  std::vector<std::pair<std::int32_t, std::int64_t>> all;
  for (const auto& values_of_block : distinct)
    for (const std::int32_t v : values_of_block) all.emplace_back(v, static_cast<std::int64_t>(all.size()));
  add_labels(firsts(std::move(all)));

  make_room(n);
  const MaterialLookup lookup(known_, smallest, range);
  result_.voxels.visit([&](auto* out) {
    parallel_for(execution_, static_cast<std::int64_t>(distinct.size()), 1,
                 [&](std::int64_t b) { lookup.fill(block(b), out + done + b * kBlock); });
  });
}

template void LabelEncoder::add(std::span<const std::int8_t>);
template void LabelEncoder::add(std::span<const std::uint8_t>);
template void LabelEncoder::add(std::span<const std::int16_t>);
template void LabelEncoder::add(std::span<const std::uint16_t>);
template void LabelEncoder::add(std::span<const std::int32_t>);
template void LabelEncoder::add(std::span<const std::uint32_t>);
template void LabelEncoder::add(std::span<const std::int64_t>);
template void LabelEncoder::add(std::span<const std::uint64_t>);

}  // namespace treemarch
