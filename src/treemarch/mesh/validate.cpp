#include "treemarch/mesh/validate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/facets.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 16384;

template <int Dim>
struct Box {
  Vec<Dim> low = Frame<Dim>::filled(std::numeric_limits<double>::infinity());
  Vec<Dim> high = Frame<Dim>::filled(-std::numeric_limits<double>::infinity());
  [[nodiscard]] double largest_side() const {
    double side = 0;
    for (int d = 0; d < Dim; ++d) side = std::max(side, high[d] - low[d]);
    return side;
  }
};

template <int Dim>
Box<Dim> bounding_box(const Mesh<Dim>& mesh, const Execution& execution) {
  auto join = [](Box<Dim> a, const Box<Dim>& b) {
    for (int d = 0; d < Dim; ++d) {
      a.low[d] = std::min(a.low[d], b.low[d]);
      a.high[d] = std::max(a.high[d], b.high[d]);
    }
    return a;
  };
  return parallel_reduce(
      execution, static_cast<std::int64_t>(mesh.points.size()), kBlock, Box<Dim>{},
      [&](std::int64_t begin, std::int64_t end) {
        Box<Dim> box;
        for (std::int64_t i = begin; i < end; ++i) box = join(box, {mesh.points[i], mesh.points[i]});
        return box;
      },
      join);
}

struct CellCounts {
  std::int64_t bad = 0, unknown = 0, inverted = 0;
  double volume = 0;
  friend CellCounts operator+(const CellCounts& a, const CellCounts& b) {
    return {a.bad + b.bad, a.unknown + b.unknown, a.inverted + b.inverted, a.volume + b.volume};
  }
};

bool is_bad(std::span<const VertexId> cell, std::size_t points) {
  for (std::size_t i = 0; i < cell.size(); ++i) {
    if (cell[i] >= points) return true;
    for (std::size_t j = 0; j < i; ++j)
      if (cell[i] == cell[j]) return true;
  }
  return false;
}

template <int Dim>
bool is_inverted(const Mesh<Dim>& mesh, CellType type, const VertexId* cell) {
  const CellTopology& shape = topology(type);
  for (int c = 0; c < shape.corner_count; ++c) {
    std::array<VertexId, Dim + 1> v{};
    for (int i = 0; i <= Dim; ++i) v[i] = cell[shape.corners[c][i]];
    if (!(simplex_determinant<Dim>(mesh.points.data(), v.data()) > 0)) return true;  // true for NaN as well
  }
  return false;
}

template <int Dim>
CellCounts examine_cells(const Mesh<Dim>& mesh, const CellBlock& block, const Execution& execution) {
  return parallel_reduce(execution, block.size(), kBlock, CellCounts{}, [&](std::int64_t begin, std::int64_t end) {
    CellCounts counts;
    for (std::int64_t c = begin; c < end; ++c) {
      const VertexId* cell = block.cell(c);
      counts.unknown += block.materials[c] >= mesh.labels.size();
      if (is_bad({cell, static_cast<std::size_t>(vertex_count(block.type))}, mesh.points.size())) {
        ++counts.bad;
        continue;
      }
      counts.inverted += is_inverted(mesh, block.type, cell);
      counts.volume += cell_volume<Dim>(mesh.points.data(), block.type, cell);
    }
    return counts;
  });
}

/// A facet as its vertices, turned so that the smallest comes first and equal facets differ in orientation alone.
struct OrientedFacet {
  std::array<VertexId, 4> vertex{};
  bool odd = false;
  bool operator==(const OrientedFacet&) const = default;
};

OrientedFacet oriented(const CellBlock& block, const FacetSide& side, int dim) {
  const LocalFacet& local = topology(block.type).facets[side.facet];
  const VertexId* cell = block.cell(side.cell);
  OrientedFacet f;
  for (int i = 0; i < local.size; ++i) f.vertex[i] = cell[local.vertex[i]];
  const auto end = f.vertex.begin() + local.size;
  if (dim == 1) {
    f.odd = side.facet == 1;
  } else if (block.type == CellType::hexahedron || (block.type == CellType::pyramid && local.size == 4)) {
    std::rotate(f.vertex.begin(), std::min_element(f.vertex.begin(), end), end);
    f.odd = f.vertex[1] > f.vertex[3];
    if (f.odd) std::swap(f.vertex[1], f.vertex[3]);
  } else {
    for (auto i = f.vertex.begin(); i != end; ++i) {
      const auto smallest = std::min_element(i, end);
      if (smallest == i) continue;
      std::iter_swap(i, smallest);
      f.odd = !f.odd;
    }
  }
  return f;
}

template <int Dim>
void examine_facets(const Mesh<Dim>& mesh, const Box<Dim>& box, const Execution& execution, MeshDefects& defects) {
  struct Counts {
    std::int64_t overused = 0, folded = 0, hull = 0, off_box = 0;
  };
  std::vector<Counts> parts(facet_part_count(static_cast<std::int64_t>(mesh.points.size())));
  const double tolerance = 1e-7 * box.largest_side();
  visit_facets<Dim>(mesh, execution, [&](std::int64_t part, std::span<const FacetSide> sides) {
    const FacetSide& side = sides[0];
    const OrientedFacet f = oriented(mesh.blocks[side.block], side, Dim);
    if (sides.size() > 2) {
      ++parts[part].overused;
    } else if (sides.size() == 2) {
      OrientedFacet g = oriented(mesh.blocks[sides[1].block], sides[1], Dim);
      g.odd = !g.odd;
      parts[part].folded += !(f == g);
    } else {
      ++parts[part].hull;
      const int size = topology(mesh.blocks[side.block].type).facets[side.facet].size;
      bool on_box = false;
      for (int d = 0; d < Dim; ++d) {
        auto all_at = [&](double x) {
          return std::all_of(f.vertex.begin(), f.vertex.begin() + size,
                             [&](VertexId v) { return std::abs(mesh.points[v][d] - x) <= tolerance; });
        };
        on_box = on_box || all_at(box.low[d]) || all_at(box.high[d]);
      }
      parts[part].off_box += !on_box;
    }
  });
  for (const Counts& c : parts) {
    defects.overused_facets += c.overused;
    defects.folded_facets += c.folded;
    defects.hull_facets += c.hull;
    defects.facets_off_the_box += c.off_box;
  }
}

template <int Dim>
std::int64_t count_unused_points(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::uint8_t> used(mesh.points.size());
  for (const CellBlock& block : mesh.blocks)
    for (const VertexId v : block.vertices) used[v] = 1;
  execution.check();
  return std::count(used.begin(), used.end(), 0);
}

template <int Dim>
std::int64_t count_coincident_points(const Mesh<Dim>& mesh, const Box<Dim>& box, const Execution& execution) {
  using Key = std::array<std::int64_t, Dim>;
  const double scale = 1e9 / std::max(box.largest_side(), std::numeric_limits<double>::min());
  const auto n = static_cast<std::int64_t>(mesh.points.size());
  std::vector<Key> keys(mesh.points.size());
  parallel_for(execution, n, kBlock, [&](std::int64_t i) {
    for (int d = 0; d < Dim; ++d) keys[i][d] = std::llround((mesh.points[i][d] - box.low[d]) * scale);
  });
  // Equal keys are indistinguishable: their order does not matter.
  parallel_sort(execution, keys);
  return parallel_reduce(execution, n, kBlock, std::int64_t{0}, [&](std::int64_t begin, std::int64_t end) {
    std::int64_t count = 0;
    for (std::int64_t i = std::max<std::int64_t>(1, begin); i < end; ++i) count += keys[i] == keys[i - 1];
    return count;
  });
}

}  // namespace

bool MeshDefects::fills_box() const {
  return sound() && facets_off_the_box == 0 && std::abs(volume - box_volume) <= 1e-9 * box_volume;
}

std::string MeshDefects::describe() const {
  std::string text;
  const std::pair<std::int64_t, const char*> counts[] = {
      {bad_cells, "cells with missing or repeated vertices"},
      {unknown_materials, "cells of unknown material"},
      {inverted_cells, "inverted cells"},
      {overused_facets, "facets of more than two cells"},
      {folded_facets, "folded facets"},
      {unused_points, "unused points"},
      {coincident_points, "coincident points"},
  };
  for (const auto& [count, what] : counts)
    if (count) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + what;
  return text.empty() ? "sound" : text;
}

template <int Dim>
MeshDefects validate(const Mesh<Dim>& mesh, const Execution& execution) {
  CellCounts cells;
  for (const CellBlock& block : mesh.blocks) cells = cells + examine_cells(mesh, block, execution);
  MeshDefects defects;
  defects.bad_cells = cells.bad;
  defects.unknown_materials = cells.unknown;
  defects.inverted_cells = cells.inverted;
  defects.volume = cells.volume;
  if (defects.bad_cells || mesh.points.empty()) return defects;

  const Box<Dim> box = bounding_box(mesh, execution);
  defects.box_volume = 1;
  for (int d = 0; d < Dim; ++d) defects.box_volume *= box.high[d] - box.low[d];
  examine_facets(mesh, box, execution, defects);
  defects.unused_points = count_unused_points(mesh, execution);
  defects.coincident_points = count_coincident_points(mesh, box, execution);
  return defects;
}

template MeshDefects validate(const Mesh<1>&, const Execution&);
template MeshDefects validate(const Mesh<2>&, const Execution&);
template MeshDefects validate(const Mesh<3>&, const Execution&);
template MeshDefects validate(const Mesh<4>&, const Execution&);

}  // namespace treemarch
