/// \file
/// Meshes of random images by the default cut, as the improvement gets them.
#pragma once

#include <numeric>
#include <vector>

#include "support/images.h"
#include "treemarch/field/field.h"
#include "treemarch/march/cut.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/simplex_quality.h"
#include "treemarch/tessellate/body_centred.h"
#include "treemarch/tree/spacetree.h"

namespace treemarch::testing {

/// Blobs, noise and sheets at once: the label of a voxel is that of the nearest of some random seeds, some voxels are
/// speckled, and one plane is a sheet of one voxel.
template <int Dim>
LabelImage<Dim> mixed_image(const Coord<Dim>& extent, int labels, double speckles, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Coord<Dim>> seeds(static_cast<std::size_t>(2 * labels));
  for (auto& s : seeds)
    for (int d = 0; d < Dim; ++d) s[d] = static_cast<std::int32_t>(random() % static_cast<unsigned>(extent[d]));
  std::vector<std::int32_t> values(static_cast<std::size_t>(product(extent)));
  for (std::int64_t i = 0; i < product(extent); ++i) {
    const Coord<Dim> c = coord_of(i, extent);
    std::int64_t best = -1;
    for (std::size_t s = 0; s < seeds.size(); ++s) {
      std::int64_t far = 0;
      for (int d = 0; d < Dim; ++d) far += std::int64_t{c[d] - seeds[s][d]} * (c[d] - seeds[s][d]);
      if (best < 0 || far < best) best = far, values[i] = static_cast<std::int32_t>(s) % labels;
    }
    if (random() % 1000 < 1000 * speckles) values[i] = static_cast<std::int32_t>(random() % unsigned(labels));
    if (c[0] + c[1] == extent[0]) values[i] = labels;
  }
  return make_label_image(extent, values);
}

/// For a patch that has all stars.
template <int Dim>
std::vector<VertexId> all_vertices(const Mesh<Dim>& mesh) {
  std::vector<VertexId> all(mesh.points.size());
  std::iota(all.begin(), all.end(), VertexId{0});
  return all;
}

template <int Dim>
struct CutImage {
  Field<Dim> field;
  Mesh<Dim> mesh;
  Vec<Dim> box;
};

/// Cells of one voxel at interfaces, up to four voxels elsewhere. \param q_floor of the cut.
template <int Dim>
CutImage<Dim> cut_image(const LabelImage<Dim>& image, double q_floor = 18) {
  Execution execution(2);
  Lattice<Dim> lattice;
  lattice.extent = image.extent;
  lattice.unit = image.frame.spacing;
  RefinementPattern<Dim> pattern;
  Coord<Dim> two{};
  two.fill(2);
  pattern.factors.assign(2, two);
  std::vector<std::uint8_t> level(static_cast<std::size_t>(product(image.extent)), 0);
  for (std::int64_t i = 0; i < product(image.extent); ++i)
    for (int d = 0; d < Dim; ++d) {
      Coord<Dim> c = coord_of(i, image.extent);
      if (++c[d] == image.extent[d] || image.voxels[i] == image.material(c)) continue;
      level[i] = level[linear_index(c, image.extent)] = 2;
    }
  const auto tree = build_spacetree<Dim>(lattice, pattern, level, 1, execution);
  CutImage<Dim> cut{build_field<Dim>(image, {}, execution), {}, image.size()};
  CutOptions options;
  options.quality_floor = q_floor;
  CutReport report;
  cut.mesh = cut_lattice<Dim>(tessellate_body_centred<Dim>(tree, execution), cut.field, image.labels, options, report,
                              execution);
  return cut;
}

/// Smallest quality of all cells, in degrees.
template <int Dim>
double worst_quality(const Mesh<Dim>& mesh) {
  double worst = 180;
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t c = 0; c < block.size(); ++c) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = mesh.points[block.cell(c)[k]];
    worst = std::min(worst, quality(angle_range<Dim>(p)));
  }
  return worst;
}

/// Volume of each material.
template <int Dim>
std::vector<double> volumes(const Mesh<Dim>& mesh) {
  std::vector<double> sum(mesh.labels.size());
  const CellBlock& block = mesh.blocks[0];
  for (std::int64_t c = 0; c < block.size(); ++c) {
    const VertexId* v = block.cell(c);
    const Vec<Dim> p = mesh.points[v[0]], x = mesh.points[v[1]] - p, y = mesh.points[v[2]] - p;
    if constexpr (Dim == 2)
      sum[block.materials[c]] += (x[0] * y[1] - x[1] * y[0]) / 2;
    else
      sum[block.materials[c]] += dot(cross(x, y), mesh.points[v[3]] - p) / 6;
  }
  return sum;
}

}  // namespace treemarch::testing
