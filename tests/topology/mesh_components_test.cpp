#include "treemarch/topology/mesh_components.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

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
  for (const ImageComponent& c : image_components(image, Execution(2))) ++expected[c.material];
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

/// Brings the cells without a vertex of another material's cell to the front, and returns how many there are.
template <int Dim>
std::int64_t sort_uniform_cells(Mesh<Dim>& mesh) {
  CellBlock& block = mesh.blocks[0];
  const auto n = static_cast<std::size_t>(block.size());
  std::vector<std::set<MaterialId>> around(mesh.points.size());
  for (std::size_t c = 0; c < n; ++c)
    for (int i = 0; i <= Dim; ++i) around[block.cell(static_cast<std::int64_t>(c))[i]].insert(block.materials[c]);
  CellBlock sorted{block.type, {}, {}};
  std::int64_t uniform = 0;
  for (const bool wanted : {true, false})
    for (std::size_t c = 0; c < n; ++c) {
      const VertexId* v = block.cell(static_cast<std::int64_t>(c));
      if (std::all_of(v, v + Dim + 1, [&](VertexId x) { return around[x].size() == 1; }) != wanted) continue;
      sorted.vertices.insert(sorted.vertices.end(), v, v + Dim + 1);
      sorted.materials.push_back(block.materials[c]);
      uniform += wanted;
    }
  block = sorted;
  return uniform;
}

template <int Dim>
void expect_same(const Mesh<Dim>& mesh, const MeshComponents<Dim>& plain, const MeshComponents<Dim>& known) {
  const Execution execution(3);
  EXPECT_EQ(plain.count(execution), known.count(execution));
  const auto as_tuple = [](const MeshPinch& p) { return std::tuple(p.vertex, p.material, p.sheets); };
  ASSERT_EQ(plain.pinches().size(), known.pinches().size());
  for (std::size_t i = 0; i < plain.pinches().size(); ++i)
    EXPECT_EQ(as_tuple(plain.pinches()[i]), as_tuple(known.pinches()[i]));
  std::map<MeshComponents<3>::Index, MeshComponents<3>::Index> number;
  for (std::int64_t c = 0; c < mesh.blocks[0].size(); ++c)
    EXPECT_EQ(number.try_emplace(plain.of(0, c), known.of(0, c)).first->second, known.of(0, c));
}

template <int Dim>
void expect_the_same_of_a_known_mesh(const LabelImage<Dim>& image, double size) {
  MeshOptions options;
  options.sizes.min_size = size;
  options.keep_background = true;
  Execution execution(3);
  Mesh<Dim> mesh = mesh_image(image, options, execution).mesh;
  for (CellBlock& block : mesh.blocks)  // breaches of all kinds
    for (std::size_t c = 0; c < block.materials.size(); c += 97)
      block.materials[c] = (block.materials[c] + 1) % static_cast<MaterialId>(mesh.labels.size());
  const std::int64_t uniform = sort_uniform_cells(mesh);
  EXPECT_GT(uniform, 0);
  const MeshComponents<Dim> plain(mesh, execution);
  expect_same(mesh, plain, MeshComponents<Dim>(mesh, execution, {image.size(), uniform}));
  const Borders borders = find_borders(mesh, execution);
  expect_same(mesh, plain, MeshComponents<Dim>(mesh, execution, {.borders = &borders}));
}

TEST(MeshComponents, WhatIsKnownOfAMeshChangesNothing) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    expect_the_same_of_a_known_mesh(testing::noise_image<3>({9, 8, 9}, 3, seed), 0.5);
    expect_the_same_of_a_known_mesh(testing::noise_image<2>({21, 18}, 3, seed), 0.5);
  }
  expect_the_same_of_a_known_mesh(testing::ball_image<3>({16, 16, 16}, 0.4), 1);
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
