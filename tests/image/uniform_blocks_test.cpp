#include "treemarch/image/uniform_blocks.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

namespace treemarch {
namespace {

/// An image of large boxes of some labels, with single voxels of others strewn in.
template <int Dim>
LabelImage<Dim> boxes(const Coord<Dim>& extent, std::int32_t labels, int strewn, unsigned seed) {
  std::mt19937 random(seed);
  const std::int64_t n = product(extent);
  std::vector<std::int32_t> values(static_cast<std::size_t>(n));
  for (std::int64_t i = 0; i < n; ++i) {
    std::int32_t v = 0;
    for (const std::int32_t c : coord_of(i, extent)) v = 2 * v + (c / (Dim == 1 ? 1000 : 40)) % 2;
    values[static_cast<std::size_t>(i)] = v;
  }
  for (int i = 0; i < labels; ++i) values[static_cast<std::size_t>(i % n)] = 1000 + i;
  for (int i = 0; i < strewn; ++i)
    values[random() % values.size()] = 1000 + static_cast<std::int32_t>(random() % static_cast<unsigned>(labels));
  return make_label_image(extent, values);
}

template <int Dim>
MaterialId brute_force(const LabelImage<Dim>& image, const VoxelBox<Dim>& box) {
  const MaterialId material = image.material(box.begin);
  bool same = true;
  for_each_row(box, image.extent, [&](Coord<Dim> c, std::int64_t at) {
    EXPECT_EQ(at, linear_index(c, image.extent));
    for (; c[0] < box.end[0]; ++c[0]) same &= image.material(c) == material;
  });
  return same ? material : UniformBlocks<Dim>::kMixed;
}

template <int Dim>
void expect_blocks(const LabelImage<Dim>& image) {
  const UniformBlocks<Dim> blocks(image, Execution(3));
  std::int64_t voxels = 0, uniform = 0;
  for (std::int64_t b = 0; b < blocks.size(); ++b) {
    const VoxelBox<Dim> box = voxels_of_block(coord_of(b, blocks.extent()), image.extent);
    ASSERT_EQ(blocks[b], brute_force(image, box)) << b;
    voxels += box.size();
    uniform += blocks[b] != UniformBlocks<Dim>::kMixed;
  }
  EXPECT_EQ(voxels, product(image.extent));
  EXPECT_GT(uniform, 0);
  EXPECT_LT(uniform, blocks.size());

  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    VoxelBox<Dim> box, whole;  // any box, and all blocks that it touches
    Coord<Dim> last;
    for (int d = 0; d < Dim; ++d) {
      const auto extent = static_cast<unsigned>(image.extent[d]);
      box.begin[d] = static_cast<std::int32_t>(random() % extent);
      last[d] = box.begin[d] + static_cast<std::int32_t>(random() % 20);
      constexpr std::int32_t kSide = UniformBlocks<Dim>::kSide;
      whole.begin[d] = box.begin[d] / kSide * kSide;
      whole.end[d] = std::min((last[d] / kSide + 1) * kSide, image.extent[d]);
    }
    ASSERT_EQ(blocks.within(box.begin, last), brute_force(image, whole));
  }
}

TEST(uniform_blocks, are_those_of_one_material_at_any_width_of_labels) {
  for (const std::int32_t labels : {2, 300, 70000}) {
    expect_blocks(boxes<3>({83, 50, 47}, labels, 20, 1));
    expect_blocks(boxes<2>({430, 211}, labels, 20, 2));
  }
  expect_blocks(boxes<1>({100003}, 5, 4, 3));
  expect_blocks(boxes<4>({43, 9, 42, 6}, 5, 20, 4));
}

TEST(uniform_blocks, whole_numbers_between_are_those_that_rounding_gives) {
  std::mt19937 random(5);
  for (int i = 0; i < 20000; ++i) {
    const auto any = [&] { return (static_cast<double>(random() % 4000) - 2000) * (i % 2 ? 0.125 : 0.0137); };
    const double low = any(), high = any();
    const auto limit = static_cast<std::int32_t>(random() % 30 + 1);
    std::vector<std::int32_t> expected;
    for (std::int32_t n = 0; n < limit; ++n)
      if (n >= low && n <= high) expected.push_back(n);
    const auto [begin, end] = whole_between(low, high, limit);
    ASSERT_EQ(std::max(0, end - begin), std::ssize(expected)) << low << " " << high << " " << limit;
    if (!expected.empty()) {
      ASSERT_EQ(begin, expected.front());
    }
    ASSERT_TRUE(begin >= 0 && begin <= limit && end >= 0 && end <= limit);
  }
}

}  // namespace
}  // namespace treemarch
