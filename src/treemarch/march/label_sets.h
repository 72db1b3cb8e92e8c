/// \file
/// The labels that are tied at each vertex of a lattice: S(v) of the default method.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// A small set of materials in ascending order. Holds up to eight; more are not told apart at one vertex.
class LabelSet {
 public:
  static constexpr int kMost = 8;

  LabelSet() = default;
  explicit LabelSet(MaterialId m) : size_(1) { items_[0] = m; }

  [[nodiscard]] std::span<const MaterialId> items() const { return {items_.data(), size_}; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool contains(MaterialId m) const {
    return std::find(items_.begin(), items_.begin() + size_, m) != items_.begin() + size_;
  }
  void insert(MaterialId m) {
    if (size_ == kMost || contains(m)) return;
    std::size_t i = size_++;
    for (; i > 0 && items_[i - 1] > m; --i) items_[i] = items_[i - 1];
    items_[i] = m;
  }
  void intersect(std::span<const MaterialId> other) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < size_; ++i)
      if (std::find(other.begin(), other.end(), items_[i]) != other.end()) items_[n++] = items_[i];
    size_ = static_cast<std::uint32_t>(n);
  }

 private:
  std::array<MaterialId, kMost> items_{};
  std::uint32_t size_ = 0;
};

/// One set a vertex; a set of one label, by far the most frequent, needs four bytes.
class VertexLabels {
 public:
  explicit VertexLabels(std::size_t vertices = 0) : entry_(vertices, 0) {}

  [[nodiscard]] std::size_t size() const { return entry_.size(); }
  [[nodiscard]] bool single(VertexId v) const { return !(entry_[v] & kMany); }
  [[nodiscard]] std::span<const MaterialId> of(VertexId v) const {
    if (single(v)) return {&entry_[v], 1};
    return many_[entry_[v] & ~kMany].items();
  }
  [[nodiscard]] LabelSet set_of(VertexId v) const {
    return single(v) ? LabelSet(entry_[v]) : many_[entry_[v] & ~kMany];
  }
  [[nodiscard]] bool contains(VertexId v, MaterialId m) const {
    return single(v) ? entry_[v] == m : many_[entry_[v] & ~kMany].contains(m);
  }
  /// Whether both vertices have the same single label.
  [[nodiscard]] bool same_single(VertexId u, VertexId v) const { return entry_[u] == entry_[v] && single(u); }
  [[nodiscard]] bool disjoint(VertexId u, VertexId v) const {
    if (single(u) && single(v)) return entry_[u] != entry_[v];
    const auto a = of(u), b = of(v);
    for (const MaterialId m : a)
      if (std::find(b.begin(), b.end(), m) != b.end()) return false;
    return true;
  }

  /// Number of the set of a vertex that is not single: sets are numbered from 0 to set_count() and keep their numbers.
  [[nodiscard]] std::uint32_t set_number(VertexId v) const { return entry_[v] & ~kMany; }
  [[nodiscard]] std::size_t set_count() const { return many_.size(); }

  void set_single(VertexId v, MaterialId m) { entry_[v] = m; }
  /// Not for several threads at once: the order of the calls numbers the sets.
  void set_many(VertexId v, const LabelSet& set) {
    if (set.size() == 1) return set_single(v, set.items()[0]);
    if (single(v)) {
      entry_[v] = kMany | static_cast<std::uint32_t>(many_.size());
      many_.push_back(set);
    } else {
      many_[entry_[v] & ~kMany] = set;
    }
  }

 private:
  static constexpr std::uint32_t kMany = 0x80000000U;
  std::vector<MaterialId> entry_;
  std::vector<LabelSet> many_;
};

}  // namespace treemarch
