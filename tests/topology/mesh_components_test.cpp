#include "treemarch/topology/mesh_components.h"

#include <gtest/gtest.h>

#include "support/images.h"
#include "support/voxel_mesh.h"
#include "treemarch/pipeline/mesh_image.h"
#include "treemarch/topology/image_components.h"

namespace treemarch {
namespace {

/// Cells that are voxels are connected as the voxels are.
template <int Dim>
void expect_as_in_image(const LabelImage<Dim>& image) {
  std::vector<std::int64_t> expected(image.labels.size());
  for (const ImageComponent& c : image_components(image)) ++expected[c.material];
  const Mesh<Dim> mesh = testing::voxel_mesh(image);
  for (const int threads : {1, 5})
    EXPECT_EQ(MeshComponents<Dim>(mesh, Execution(threads)).count(Execution(threads)), expected);
}

TEST(MeshComponents, OfAMeshThatRepeatsTheImageAreThoseOfTheImage) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const int labels = 1 + static_cast<int>(seed % 5);
    expect_as_in_image(testing::noise_image<2>({17, 13}, labels, seed));
    expect_as_in_image(testing::noise_image<3>({19, 11, 17}, labels, seed));
  }
  expect_as_in_image(testing::ball_image<3>({20, 21, 22}, 0.3));
}

/// Flood fill from cell to cell over facets, found by comparing all pairs that share a vertex.
std::vector<std::int64_t> brute_force(const Mesh<3>& mesh) {
  const CellBlock& block = mesh.blocks[0];
  const auto n = static_cast<std::size_t>(block.size());
  std::vector<std::vector<std::size_t>> around(mesh.points.size());
  for (std::size_t c = 0; c < n; ++c)
    for (int i = 0; i < 4; ++i) around[block.cell(static_cast<std::int64_t>(c))[i]].push_back(c);
  const auto shared = [&](std::size_t a, std::size_t b) {
    const VertexId* u = block.cell(static_cast<std::int64_t>(a));
    const VertexId* v = block.cell(static_cast<std::int64_t>(b));
    return std::count_if(u, u + 4, [&](VertexId x) { return std::find(v, v + 4, x) != v + 4; });
  };
  std::vector<std::int64_t> count(mesh.labels.size());
  std::vector<char> seen(n);
  for (std::size_t c = 0; c < n; ++c) {
    if (seen[c]) continue;
    ++count[block.materials[c]];
    std::vector<std::size_t> stack{c};
    seen[c] = 1;
    while (!stack.empty()) {
      const std::size_t at = stack.back();
      stack.pop_back();
      for (int i = 0; i < 4; ++i) {
        for (const std::size_t next : around[block.cell(static_cast<std::int64_t>(at))[i]]) {
          if (seen[next] || block.materials[next] != block.materials[at] || shared(at, next) != 3) continue;
          seen[next] = 1;
          stack.push_back(next);
        }
      }
    }
  }
  return count;
}

TEST(MeshComponents, OfRealMeshesAgreeWithAFloodFill) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    MeshOptions options;
    options.method = seed % 2 ? Method::paper : Method::guaranteed;
    options.sizes.min_size = 1;
    options.keep_background = seed % 3 == 0;
    Execution execution(2);
    const Mesh<3> mesh = mesh_image(testing::noise_image<3>({10, 9, 8}, 4, seed), options, execution).mesh;
    EXPECT_EQ(MeshComponents<3>(mesh, execution).count(execution), brute_force(mesh));
  }
}

TEST(MeshComponents, DoNotDependOnTheNumbersOfVertices) {
  for (const auto& image : {testing::noise_image<3>({9, 8, 7}, 3, 4), testing::ball_image<3>({12, 12, 12}, 0.4)}) {
    Mesh<3> mesh = testing::voxel_mesh(image);
    const auto expected = MeshComponents<3>(mesh, Execution(2)).count(Execution(2));
    const auto last = static_cast<VertexId>(mesh.points.size() - 1);
    std::ranges::reverse(mesh.points);
    for (CellBlock& block : mesh.blocks)
      for (VertexId& v : block.vertices) v = last - v;
    EXPECT_EQ(MeshComponents<3>(mesh, Execution(2)).count(Execution(2)), expected);
  }
}

}  // namespace
}  // namespace treemarch
