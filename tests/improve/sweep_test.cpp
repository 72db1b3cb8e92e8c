#include "treemarch/improve/sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "improve/improve_meshes.h"

namespace treemarch {
namespace {

/// Half way to the mean of the cells around a vertex.
Vec<3> half_way(const Patch<3>& patch, VertexId v) {
  Vec<3> sum{};
  for (const CellId c : patch.star(v)) sum = sum + patch.centroid(c);
  return 0.5 * patch.point(v) + (0.5 / static_cast<double>(patch.star(v).size())) * sum;
}

/// Where the sweep leaves the vertices that each move half way, some excepted.
Points<3> smoothed(const testing::CutImage<3>& cut, const std::vector<VertexId>& vertices, int threads) {
  Mesh<3> mesh = cut.mesh;
  const Execution execution(threads);
  std::vector<VertexId> sorted = vertices;
  std::ranges::sort(sorted);
  Patch<3> patch(mesh, sorted, execution);
  std::vector<std::uint32_t> place(mesh.points.size(), 0xffffffffU);
  for (std::size_t i = 0; i < vertices.size(); ++i) place[vertices[i]] = static_cast<std::uint32_t>(i);
  const Turns turns(vertices, execution, [&](std::int64_t i, const auto& add) {
    for (const CellId c : patch.star(vertices[i]))
      for (const VertexId w : patch.cell(c))
        if (place[w] != 0xffffffffU) add(place[w]);
  });
  const auto move = [&](std::uint32_t i) {
    const VertexId v = vertices[i];
    if (v % 7 == 0) return false;
    patch.move(v, half_way(patch, v));
    return true;
  };
  std::int64_t expected = 0;
  for (const VertexId v : vertices) expected += v % 7 != 0;
  EXPECT_EQ(sweep(turns, execution, move), expected);
  return mesh.points;
}

/// Whatever the threads and the order of the list, it is as if one vertex moved after the other, by their hashes.
TEST(Sweep, MovesOneAfterTheOther) {
  const auto cut = testing::cut_image(testing::mixed_image<3>({12, 12, 11}, 4, 0.02, 2));
  std::vector<VertexId> vertices;
  for (VertexId v = 0; v < cut.mesh.points.size(); ++v)
    if (v % 5 != 0 && v % 3 != 0) vertices.push_back(v);
  ASSERT_GT(vertices.size(), 1500U);
  const Points<3> points = smoothed(cut, vertices, 1);
  for (const int threads : {2, 7}) EXPECT_EQ(smoothed(cut, vertices, threads), points);

  std::vector<std::pair<std::uint64_t, VertexId>> by_hash;
  by_hash.reserve(vertices.size());
  for (const VertexId v : vertices) by_hash.push_back({scramble(v), v});
  std::ranges::sort(by_hash);
  Mesh<3> mesh = cut.mesh;
  Patch<3> patch(mesh, testing::all_vertices(mesh), Execution(1));
  for (const auto& [hash, v] : by_hash) {
    if (v % 7 != 0) patch.move(v, half_way(patch, v));
  }
  EXPECT_EQ(mesh.points, points);

  std::ranges::reverse(vertices);
  EXPECT_EQ(smoothed(cut, vertices, 2), points);
}

}  // namespace
}  // namespace treemarch
