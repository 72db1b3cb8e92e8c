#include "treemarch/field/bricks.h"

#include <algorithm>
#include <array>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {

namespace {

constexpr int kMostInTable = 8;

/// Lays out one brick after another. One object a thread: it holds the scratch memory.
template <int Dim>
class BrickMaker {
 public:
  explicit BrickMaker(const VoxelLists<Dim>& lists) : lists_(lists) {
    for (int i = 0; i < kVoxels; ++i) {
      Coord<Dim> c = coord_of(i, kBox);
      source_corner_[i] = 0;
      for (int d = 0; d < Dim; ++d) source_corner_[i] |= (c[d] == Bricks<Dim>::kSide ? 1 : 0) << d;
      source_place_[i] = VoxelLists<Dim>::place_in_brick(c);
    }
  }

  /// Appends brick number `index` to the chunk and returns its reference.
  std::uint64_t make(std::int64_t index, std::uint64_t chunk_id, std::vector<std::uint32_t>& chunk) {
    const Coord<Dim> brick = coord_of(index, lists_.brick_extent);
    std::uint64_t refs[1 << Dim];
    bool at_end = false;  // whether voxels beyond the image are needed
    bool same = true;
    for (int corner = 0; corner < 1 << Dim; ++corner) {
      Coord<Dim> c = brick;
      for (int d = 0; d < Dim; ++d) c[d] = std::min(c[d] + (corner >> d & 1), lists_.brick_extent[d] - 1);
      refs[corner] = lists_.refs[linear_index(c, lists_.brick_extent)];
      same &= refs[corner] == refs[0];
    }
    if (same && (refs[0] & VoxelLists<Dim>::kUniform) != 0) return refs[0];
    for (int d = 0; d < Dim; ++d) at_end |= (brick[d] + 1) * Bricks<Dim>::kSide + 1 > lists_.extent[d];

    materials_.fill(kOutside);
    weights_.fill(0);
    own_.fill(0);
    used_ = 0;
    for (int i = 0; i < kVoxels; ++i) {
      std::uint64_t ref = refs[source_corner_[i]];
      int place = source_place_[i];
      if (at_end) find_source(brick, i, ref, place);
      int slot = 0;
      bool own = true;
      lists_.visit_voxel(ref, place, [&](MaterialId m, std::uint32_t w) {
        if (slot == kMostInTable || (w == 0 && !own)) return;
        slot = put(i, m, w);
        if (own && source_corner_[i] == 0)
          own_[source_place_[i] / 8] |= static_cast<std::uint32_t>(slot & 7) << (4 * (source_place_[i] % 8));
        own = false;
      });
      if (slot == kMostInTable) return make_lists(brick, chunk_id, chunk);
    }
    if (used_ == 1) return Bricks<Dim>::kUniform | materials_[0];
    return make_table(chunk_id, chunk);
  }

 private:
  static constexpr int kVoxels = Bricks<Dim>::kVoxels;
  static constexpr Coord<Dim> kBox = [] {
    Coord<Dim> c{};
    c.fill(Bricks<Dim>::kReach);
    return c;
  }();

  /// Where the lists hold a voxel of the brick; beyond the image the last voxel counts.
  void find_source(const Coord<Dim>& brick, int i, std::uint64_t& ref, int& place) const {
    Coord<Dim> voxel = coord_of(i, kBox);
    for (int d = 0; d < Dim; ++d) voxel[d] = std::min(brick[d] * Bricks<Dim>::kSide + voxel[d], lists_.extent[d] - 1);
    ref = lists_.refs[lists_.brick_of(voxel)];
    place = VoxelLists<Dim>::place_in_brick(voxel);
  }

  /// Enters a weight into the table; returns the label's slot, kMostInTable if there is no room for another.
  int put(int voxel, MaterialId material, std::uint32_t weight) {
    int slot = 0;
    while (slot < used_ && materials_[slot] != material) ++slot;
    if (slot == kMostInTable) return slot;
    if (slot == used_) materials_[used_++] = material;
    weights_[voxel * kMostInTable + slot] = static_cast<std::uint16_t>(weight);
    return slot;
  }

  [[nodiscard]] std::uint64_t make_table(std::uint64_t chunk_id, std::vector<std::uint32_t>& chunk) const {
    const unsigned form = used_ <= 2 ? Bricks<Dim>::kTable2 : used_ <= 4 ? Bricks<Dim>::kTable4 : Bricks<Dim>::kTable8;
    const int slots = 1 << form;
    const std::uint64_t ref = (std::uint64_t{form} << 60) | (chunk_id << 32) | chunk.size();
    chunk.insert(chunk.end(), materials_.begin(), materials_.begin() + slots);
    chunk.insert(chunk.end(), own_.begin(), own_.end());
    for (int i = 0; i < kVoxels; ++i)
      for (int slot = 0; slot < slots; slot += 2) {
        const std::uint16_t* w = &weights_[i * kMostInTable + slot];
        chunk.push_back(w[0] | std::uint32_t{w[1]} << 16);
      }
    return ref;
  }

  std::uint64_t make_lists(const Coord<Dim>& brick, std::uint64_t chunk_id, std::vector<std::uint32_t>& chunk) const {
    const std::size_t begin = chunk.size();
    chunk.resize(begin + kVoxels + 1);
    for (int i = 0; i < kVoxels; ++i) {
      chunk[begin + i] = static_cast<std::uint32_t>(chunk.size() - begin);
      std::uint64_t ref = 0;
      int place = 0;
      find_source(brick, i, ref, place);
      lists_.visit_voxel(ref, place, [&](MaterialId m, std::uint32_t w) {
        if (w != 0 || chunk.size() == begin + chunk[begin + i]) chunk.insert(chunk.end(), {m, w});
      });
    }
    chunk[begin + kVoxels] = static_cast<std::uint32_t>(chunk.size() - begin);
    return (chunk_id << 32) | begin;
  }

  const VoxelLists<Dim>& lists_;
  std::array<int, kVoxels> source_corner_;
  std::array<int, kVoxels> source_place_;
  std::array<MaterialId, kMostInTable> materials_{};
  std::array<std::uint16_t, static_cast<std::size_t>(kVoxels) * kMostInTable> weights_{};
  std::array<std::uint32_t, Bricks<Dim>::kOwnWords> own_{};
  int used_ = 0;
};

}  // namespace

template <int Dim>
Bricks<Dim> make_bricks(const VoxelLists<Dim>& lists, const Execution& execution) {
  constexpr std::int64_t kBricksPerChunk = 64;
  Bricks<Dim> bricks;
  bricks.extent = lists.extent;
  bricks.brick_extent = lists.brick_extent;
  const auto count = static_cast<std::int64_t>(lists.refs.size());
  const std::int64_t chunks = block_count(count, kBricksPerChunk);
  if (chunks >= std::int64_t{1} << 28) throw Error(ErrorKind::limits, "image: too many voxels for a field; crop it");
  bricks.refs.resize(lists.refs.size());
  bricks.chunks.resize(static_cast<std::size_t>(chunks));
  parallel_for_ranges(execution, chunks, 16, [&](std::int64_t begin, std::int64_t end) {
    BrickMaker<Dim> maker(lists);
    std::vector<std::uint32_t> chunk;
    for (std::int64_t c = begin; c < end; ++c) {
      chunk.clear();
      for (std::int64_t b = c * kBricksPerChunk; b < std::min(count, (c + 1) * kBricksPerChunk); ++b)
        bricks.refs[b] = maker.make(b, static_cast<std::uint64_t>(c), chunk);
      if (!chunk.empty()) bricks.chunks[c].assign(chunk.begin(), chunk.end());
    }
  });
  return bricks;
}

template Bricks<2> make_bricks(const VoxelLists<2>&, const Execution&);
template Bricks<3> make_bricks(const VoxelLists<3>&, const Execution&);

}  // namespace treemarch
