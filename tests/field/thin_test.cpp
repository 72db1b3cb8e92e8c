#include "treemarch/field/thin.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <numeric>

#include "field/shapes.h"
#include "treemarch/field/field.h"

namespace treemarch {
namespace {

/// The material that wins at the centre of a voxel, kOutside if two weigh the same.
template <int Dim>
MaterialId winner(const Field<Dim>& field, const Coord<Dim>& voxel) {
  std::array<LabelWeight, 2> out{};
  const int n = field.sample(centre_of(voxel), out);
  return n == 2 && out[0].weight == out[1].weight ? kOutside : out[0].material;
}

/// Component of each voxel: voxels of one material that touch by a face, an edge or a corner.
template <int Dim>
std::vector<std::int64_t> components(const Coord<Dim>& extent, const std::vector<MaterialId>& material) {
  std::vector<std::int64_t> parent(material.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int64_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  Coord<Dim> around{};
  around.fill(3);
  for (std::int64_t i = 0; i < product(extent); ++i)
    for (std::int64_t k = 0; k < product(around); ++k) {
      Coord<Dim> n = coord_of(i, extent);
      const Coord<Dim> o = coord_of(k, around);
      bool inside = true;
      for (int d = 0; d < Dim; ++d) {
        n[d] += o[d] - 1;
        inside &= n[d] >= 0 && n[d] < extent[d];
      }
      if (!inside) continue;
      const std::int64_t j = linear_index(n, extent);
      if (material[i] == material[j]) parent[std::max(root(i), root(j))] = std::min(root(i), root(j));
    }
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = root(static_cast<std::int64_t>(i));
  return parent;
}

struct Kept {
  int components = 0;  ///< of the image
  int lost = 0;        ///< of these, without a voxel where their label wins
  int split = 0;       ///< of these, the voxels where their label wins do not hang together
};

template <int Dim>
Kept kept(const LabelImage<Dim>& image, bool keep_thin = true) {
  Execution execution(2);
  FieldOptions options;
  options.keep_thin = keep_thin;
  const auto field = build_field(image, options, execution);
  std::vector<MaterialId> material(static_cast<std::size_t>(product(image.extent)));
  auto winning = material;
  for (std::size_t i = 0; i < material.size(); ++i) {
    const auto c = coord_of(static_cast<std::int64_t>(i), image.extent);
    material[i] = image.material(c);
    winning[i] = winner(field, c) == material[i] ? material[i] : kOutside;
  }
  const auto before = components(image.extent, material);
  const auto after = components(image.extent, winning);
  std::map<std::int64_t, std::map<std::int64_t, int>> parts;
  for (std::size_t i = 0; i < material.size(); ++i) {
    auto& p = parts[before[i]];
    if (winning[i] != kOutside) ++p[after[i]];
  }
  Kept k;
  for (const auto& [component, p] : parts) {
    ++k.components;
    k.lost += p.empty();
    k.split += p.size() > 1;
  }
  return k;
}

LabelImage<3> shape(const std::function<bool(const Coord<3>&)>& inside) {
  return image_of<3>({24, 25, 26}, [&](const Coord<3>& c) { return inside(c) ? 7 : 3; });
}

bool away_from_box(const Coord<3>& c) {
  for (int d = 0; d < 3; ++d)
    if (c[d] < 4 || c[d] > 19) return false;
  return true;
}

const std::map<std::string, LabelImage<3>>& thin_shapes() {
  static const std::map<std::string, LabelImage<3>> shapes = {
      {"grain", shape([](const Coord<3>& c) {
         return c == Coord<3>{9, 10, 11};
       })},
      {"grain in a corner of the box", shape([](const Coord<3>& c) {
         return c == Coord<3>{23, 24, 25};
       })},
      {"axis-parallel wire", shape([](const Coord<3>& c) { return c[1] == 10 && c[2] == 11 && away_from_box(c); })},
      {"wire through the box", shape([](const Coord<3>& c) { return c[0] == 9 && c[2] == 11; })},
      {"wire along a face diagonal", shape([](const Coord<3>& c) { return c[0] == c[1] && c[2] == 11; })},
      {"wire along a body diagonal", shape([](const Coord<3>& c) { return c[0] == c[1] && c[1] == c[2]; })},
      {"oblique wire", shape([](const Coord<3>& c) { return c[1] == c[0] / 2 + 5 && c[2] == c[0] / 3 + 9; })},
      {"axis-parallel sheet", shape([](const Coord<3>& c) { return c[2] == 12 && away_from_box(c); })},
      {"sheet (110)", shape([](const Coord<3>& c) { return c[0] + c[1] == 24; })},
      {"sheet (111)", shape([](const Coord<3>& c) { return c[0] + c[1] + c[2] == 36; })},
      {"thick sheet (111)", shape([](const Coord<3>& c) { return (c[0] + c[1] + c[2]) / 2 == 18; })},
      {"oblique sheet", shape([](const Coord<3>& c) { return (3 * c[0] + 2 * c[1] + 7 * c[2]) / 7 == 20; })},
      {"gap between two halves", shape([](const Coord<3>& c) { return c[0] != 11; })},
      {"dumbbell", shape([](const Coord<3>& c) {
         return away_from_box(c) && (c[0] < 10 || c[0] > 12 || (c[1] == 11 && c[2] == 12));
       })},
      {"dumbbell with a neck of one voxel",
       shape([](const Coord<3>& c) { return away_from_box(c) && (c[0] != 11 || (c[1] == 11 && c[2] == 12)); })},
  };
  return shapes;
}

TEST(Thin, ThinShapesStayInOnePiece) {
  for (const auto& [name, image] : thin_shapes()) {
    SCOPED_TRACE(name);
    const Kept k = kept(image);
    EXPECT_EQ(k.lost, 0);
    EXPECT_EQ(k.split, 0);
  }
}

TEST(Thin, WithoutTheFallbackSomeAreLost) {
  int lost = 0;
  for (const auto& [name, image] : thin_shapes()) lost += kept(image, false).lost;
  EXPECT_GE(lost, 4);
}

TEST(Thin, ThinShapesStayInOnePieceIn2D) {
  const auto in_2d = [](const std::function<bool(int, int)>& inside) {
    return image_of<2>({40, 37}, [&](const Coord<2>& c) { return inside(c[0], c[1]) ? 1 : 0; });
  };
  for (const auto& image :
       {in_2d([](int x, int y) { return x == 20 && y == 11; }),
        in_2d([](int x, int y) { return x == 20 && y > 4 && y < 30; }), in_2d([](int x, int y) { return x == y; }),
        in_2d([](int x, int y) { return y == x / 2 + 5; }),
        in_2d([](int x, int y) { return y > 9 && y < 25 && (x < 18 || x > 20 || y == 13); })}) {
    const Kept k = kept(image);
    EXPECT_EQ(k.lost, 0);
    EXPECT_EQ(k.split, 0);
  }
}

template <class T>
class ThinNoise : public testing::Test {};
template <int D>
struct Dimension {
  static constexpr int value = D;
};
using Dimensions = testing::Types<Dimension<2>, Dimension<3>>;
TYPED_TEST_SUITE(ThinNoise, Dimensions);

TYPED_TEST(ThinNoise, NoComponentIsLost) {
  constexpr int kDim = TypeParam::value;
  int split = 0;
  int components = 0;
  for (int labels : {2, 4, 8, 32})
    for (int patch : {1, 2, 3}) {
      const Kept k = kept(random_labels<kDim>(box<kDim>({36, 31, 29}), labels, patch, 10U * labels + patch));
      EXPECT_EQ(k.lost, 0) << labels << " labels in patches of " << patch;
      split += k.split;
      components += k.components;
    }
  EXPECT_LE(split, components / 50);
}

TEST(Thin, RoundShapesAreLeftAlone) {
  const auto ball = shape([](const Coord<3>& c) {
    const Vec<3> x = centre_of(c) - Vec<3>{12.1, 12.4, 12.7};
    return norm(x) < 8.3;
  });
  Execution execution(1);
  FieldOptions options;
  const auto with = build_field(ball, options, execution);
  options.keep_thin = false;
  EXPECT_EQ(with.bricks().chunks, build_field(ball, options, execution).bricks().chunks);
}

TEST(Thin, CountsWhatBecameRaw) {
  const auto image = shape([](const Coord<3>& c) { return c == Coord<3>{9, 10, 11}; });
  Execution execution(2);
  VoxelLists<3> lists;
  lists.extent = image.extent;
  lists.brick_extent = {6, 7, 7};
  lists.refs.assign(6 * 7 * 7, VoxelLists<3>::kUniform);
  std::vector<std::uint64_t> flagged(lists.refs.size());
  EXPECT_EQ(keep_thin(image, flagged, lists, execution), 0);
  const Coord<3> grain{9, 10, 11};
  flagged[lists.brick_of(grain)] = std::uint64_t{1} << VoxelLists<3>::place_in_brick(grain);
  EXPECT_EQ(keep_thin(image, flagged, lists, execution), 27);
}

}  // namespace
}  // namespace treemarch
