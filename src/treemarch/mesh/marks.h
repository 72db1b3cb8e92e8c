/// \file
/// Sets of vertices.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// A set of vertices of a mesh, or of places on a raster. One bit each, so that the marks of a large mesh stay in the
/// cache.
class Marks {
 public:
  explicit Marks(std::size_t size) : words_(size / 64 + 1) {}
  [[nodiscard]] bool operator[](std::size_t v) const { return (words_[v / 64] >> v % 64 & 1) != 0; }
  /// May be called from several threads, while nobody reads.
  void mark(std::size_t v) { add(v / 64, std::uint64_t{1} << v % 64); }
  /// Marks `count` places from `first` on, by words. May be called from several threads, while nobody reads.
  void mark_run(std::size_t first, std::size_t count) {
    for (const std::size_t end = first + count; first < end;) {
      const std::size_t bits = std::min(64 - first % 64, end - first);
      add(first / 64, (~std::uint64_t{0} >> (64 - bits)) << first % 64);
      first += bits;
    }
  }
  /// All, ascending.
  [[nodiscard]] std::vector<VertexId> vertices() const {
    std::vector<VertexId> vertices;
    for (std::size_t w = 0; w < words_.size(); ++w)
      for (std::uint64_t left = words_[w]; left != 0; left &= left - 1)
        vertices.push_back(static_cast<VertexId>(64 * w) + static_cast<VertexId>(std::countr_zero(left)));
    return vertices;
  }

 private:
  void add(std::size_t w, std::uint64_t bits) {
    const std::atomic_ref word(words_[w]);
    if ((word.load(std::memory_order_relaxed) & bits) != bits) word.fetch_or(bits, std::memory_order_relaxed);
  }
  std::vector<std::uint64_t> words_;
};

}  // namespace treemarch
