#include "treemarch/image/label_image.h"

#include <algorithm>

#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = std::int64_t{1} << 18;
/// Up to this many possible values a table maps values to materials; beyond, a sorted array does.
constexpr std::int64_t kLargestTable = std::int64_t{1} << 16;

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
      distinct.push_back(static_cast<std::int32_t>(v));
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
  for (const auto& e : entries) result.push_back(e.first);
  return result;
}

/// The same for any range.
template <class T>
std::vector<std::int32_t> distinct_by_sorting(std::span<const T> values) {
  std::vector<std::pair<std::int32_t, std::int64_t>> runs;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i == 0 || values[i] != values[i - 1])
      runs.emplace_back(static_cast<std::int32_t>(values[i]), static_cast<std::int64_t>(i));
  return firsts(std::move(runs));
}

/// Material of each value: a table over the range of the values, or sorted values.
class MaterialLookup {
 public:
  MaterialLookup(const std::vector<std::int32_t>& labels, std::int64_t smallest, std::int64_t range)
      : smallest_(smallest) {
    if (range <= kLargestTable) {
      table_.resize(static_cast<std::size_t>(range));
      for (std::size_t m = 0; m < labels.size(); ++m)
        table_[static_cast<std::size_t>(labels[m] - smallest)] = static_cast<MaterialId>(m);
      return;
    }
    for (std::size_t m = 0; m < labels.size(); ++m) sorted_.emplace_back(labels[m], static_cast<MaterialId>(m));
    std::sort(sorted_.begin(), sorted_.end());
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
        const auto label = static_cast<std::int32_t>(values[i]);
        last = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair<std::int32_t, MaterialId>(label, 0))->second;
      }
      out[i] = static_cast<Out>(last);
    }
  }

 private:
  std::int64_t smallest_;
  std::vector<MaterialId> table_;
  std::vector<std::pair<std::int32_t, MaterialId>> sorted_;
};

}  // namespace

MaterialId material_of(const std::vector<std::int32_t>& labels, std::int32_t label) {
  const auto at = std::ranges::find(labels, label);
  return at == labels.end() ? kOutside : static_cast<MaterialId>(at - labels.begin());
}

template <class T>
EncodedLabels encode_labels(std::span<const T> values, const Execution& execution) {
  EncodedLabels result;
  const auto n = static_cast<std::int64_t>(values.size());
  if (n == 0) return result;
  const auto whole = parallel_reduce(
      execution, n, kBlock, BlockSummary<T>{values[0], values[0], 0},
      [&](std::int64_t begin, std::int64_t end) { return summarize(values, begin, end); },
      [](const BlockSummary<T>& a, const BlockSummary<T>& b) {
        return BlockSummary<T>{std::min(a.smallest, b.smallest), std::max(a.largest, b.largest), a.changes + b.changes};
      });
  result.changes = whole.changes;
  const auto smallest = static_cast<std::int64_t>(whole.smallest);
  const std::int64_t range = static_cast<std::int64_t>(whole.largest) - smallest + 1;

  // First appearance in the whole is first appearance in the earliest block that has the value.
  std::vector<std::vector<std::int32_t>> distinct(static_cast<std::size_t>(block_count(n, kBlock)));
  const auto block = [&](std::int64_t b) {
    return values.subspan(static_cast<std::size_t>(b * kBlock),
                          static_cast<std::size_t>(std::min(kBlock, n - b * kBlock)));
  };
  parallel_for(execution, static_cast<std::int64_t>(distinct.size()), 1, [&](std::int64_t b) {
    distinct[static_cast<std::size_t>(b)] = range <= kLargestTable
                                                ? distinct_by_table(block(b), smallest, static_cast<std::size_t>(range))
                                                : distinct_by_sorting(block(b));
  });
  std::vector<std::pair<std::int32_t, std::int64_t>> all;
  for (const auto& values_of_block : distinct)
    for (const std::int32_t v : values_of_block) all.emplace_back(v, static_cast<std::int64_t>(all.size()));
  result.labels = firsts(std::move(all));

  const MaterialLookup lookup(result.labels, smallest, range);
  result.voxels = CompactArray(n, result.labels.size());
  result.voxels.visit([&](auto* out) {
    parallel_for(execution, static_cast<std::int64_t>(distinct.size()), 1,
                 [&](std::int64_t b) { lookup.fill(block(b), out + b * kBlock); });
  });
  return result;
}

template <int Dim>
LabelImage<Dim> make_label_image(const Coord<Dim>& extent, const std::vector<std::int32_t>& values,
                                 const Frame<Dim>& frame) {
  const Execution serial(1);
  EncodedLabels encoded = encode_labels(std::span<const std::int32_t>(values), serial);
  LabelImage<Dim> image;
  image.extent = extent;
  image.frame = frame;
  image.voxels = std::move(encoded.voxels);
  image.labels = std::move(encoded.labels);
  return image;
}

template EncodedLabels encode_labels(std::span<const std::int8_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::uint8_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::int16_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::uint16_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::int32_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::uint32_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::int64_t>, const Execution&);
template EncodedLabels encode_labels(std::span<const std::uint64_t>, const Execution&);

template LabelImage<1> make_label_image(const Coord<1>&, const std::vector<std::int32_t>&, const Frame<1>&);
template LabelImage<2> make_label_image(const Coord<2>&, const std::vector<std::int32_t>&, const Frame<2>&);
template LabelImage<3> make_label_image(const Coord<3>&, const std::vector<std::int32_t>&, const Frame<3>&);
template LabelImage<4> make_label_image(const Coord<4>&, const std::vector<std::int32_t>&, const Frame<4>&);

}  // namespace treemarch
