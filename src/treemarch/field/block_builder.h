/// \file
/// Label weights in one block of voxels: the inner step of build_field().
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "treemarch/field/kernel.h"
#include "treemarch/field/voxel_lists.h"
#include "treemarch/image/label_image.h"
#include "treemarch/image/uniform_blocks.h"

namespace treemarch {

/// Linear filter of the indicators: scale * first - second, each separable; nothing at all where `first` has no taps.
struct IndicatorFilter {
  Kernel first;
  Kernel second;
  float scale = 1;
  int band = 0;  ///< voxels farther (in each axis) than this from any other label weigh 1

  [[nodiscard]] bool none() const { return first.tap.empty(); }
  [[nodiscard]] int radius() const;
};

/// Grey values that decide between the background and the rest.
struct GreyRule {
  const float* values = nullptr;  ///< one a voxel, or null: no grey values
  MaterialId background = kOutside;
  double threshold = 0;
  double slope = 0;  ///< the foreground's share is 1/2 + slope * (value - threshold), within [0, 1]
};

/// Fills the bricks of one block after another. One object a thread: it holds the scratch memory.
template <int Dim>
class BlockBuilder {
 public:
  static constexpr int kSide = Dim == 3 ? 16 : 32;  ///< voxels along each side of a block

  /// \param uniform of the image. \pre all arguments outlive the object
  BlockBuilder(const LabelImage<Dim>& image, const UniformBlocks<Dim>& uniform, const IndicatorFilter& filter,
               const GreyRule& grey);

  /// Fills refs and chunk of the block, and a bit a voxel where the voxel's own label does not win by a margin.
  /// \param flagged one word a brick, or null.
  void build(const Coord<Dim>& block, std::uint32_t chunk_id, VoxelLists<Dim>& lists, std::uint64_t* flagged);

 private:
  static constexpr int kDepth = Dim == 3 ? kSide : 1;
  static constexpr int kVoxels = kSide * kSide * kDepth;
  static constexpr int kBricksPerSide = kSide / VoxelLists<Dim>::kSide;
  static constexpr int kBricks = kVoxels / VoxelLists<Dim>::kVoxels;

  /// Voxels [x0, x1) of a row of the block with its halo, of one label.
  struct Run {
    std::uint32_t label;
    std::int16_t x0, x1, y, z;
  };
  /// Voxels of the block along the second and third axis, whole rows of the first.
  struct Rows {
    int y0, y1, z0, z1;
    [[nodiscard]] bool is_empty() const { return y0 >= y1 || z0 >= z1; }
  };
  struct Item {
    std::uint32_t word;
    std::uint16_t place;
  };

  bool write_uniform(const Coord<Dim>& block, VoxelLists<Dim>& lists) const;
  void gather_runs(const Coord<Dim>& block);
  template <class T>
  void gather_row(const T* row, std::int32_t first, int y, int z);
  void add_run(MaterialId material, int x0, int x1, int y, int z);
  bool find_mixed_bricks();
  void sort_runs();
  void fill_own();
  /// Calls f(first voxel, count) for the rows of each plane.
  template <class F>
  static void for_rows(const Rows& rows, F&& f) {
    for (int z = rows.z0; z < rows.z1; ++z) f((z * kSide + rows.y0) * kSide, (rows.y1 - rows.y0) * kSide);
  }
  Rows rows_near(const Run* first, const Run* last, int r) const;
  void smooth_labels();
  void smooth_label(std::uint32_t label);
  void smooth(const Kernel& kernel, const Run* first, const Run* last, std::vector<float>& out);
  void collect(std::uint32_t label, const Rows& rows);
  void sort_items();
  void mix_grey(const Coord<Dim>& voxel, std::vector<std::uint32_t>& entries);
  bool near_border_of_foreground(int x, int y, int z) const;
  bool list_voxel(const Coord<Dim>& voxel, const Coord<Dim>& block, int place);
  std::uint64_t list_brick(const Coord<Dim>& brick, const Coord<Dim>& block, int first_place);
  std::uint64_t append_brick(std::uint32_t chunk_id, std::vector<std::uint32_t>& chunk) const;
  void write_bricks(const Coord<Dim>& block, std::uint32_t chunk_id, VoxelLists<Dim>& lists, std::uint64_t* flagged);

  const LabelImage<Dim>& image_;
  const UniformBlocks<Dim>& uniform_;
  const IndicatorFilter& filter_;
  const GreyRule& grey_;
  int halo_;
  int side_;   // kSide and the halo on both sides
  int depth_;  // the same along the third axis, 1 in 2D

  std::vector<std::uint16_t> place_of_;     // brick * 64 + place in brick, of each voxel of the block
  std::vector<std::uint32_t> local_of_;     // index in palette_ of each material of the image
  std::vector<MaterialId> palette_;         // materials of the block and its halo
  std::vector<Run> runs_;                   // by row, later by label
  std::vector<std::uint32_t> first_run_;    // of each label, after sort_runs()
  std::vector<std::uint8_t> mixed_;         // whether a brick of the block is
  std::vector<std::uint32_t> own_;          // label of each place
  std::vector<std::uint32_t> own_weight_;   // of each place
  std::vector<Item> items_;                 // entries of other labels than the voxel's own, by label
  std::vector<std::uint32_t> first_item_;   // of each place, after sort_items()
  std::vector<std::uint32_t> words_;        // entries by place
  std::vector<std::uint32_t> entries_;      // of one voxel
  std::vector<std::uint32_t> lists_;        // entries of one brick
  std::array<std::uint32_t, 64> list_end_;  // of each voxel in lists_
  Rows rows_{};                             // of the mixed bricks
  std::vector<float> line_, along_x_, along_y_, value_, second_value_;
  std::vector<float> left_, second_left_;  // for the labels that are not smoothed yet
  std::vector<std::uint64_t> foreground_;  // a bit a voxel, one word a row of the block with its halo
};

}  // namespace treemarch
