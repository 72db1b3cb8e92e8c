#include "treemarch/smooth/strata.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <tuple>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {

namespace {

const CellBlock& find_simplices(const std::vector<CellBlock>& blocks, CellType simplex) {
  static const CellBlock empty;
  const auto found = std::ranges::find(blocks, simplex, &CellBlock::type);
  return found == blocks.end() ? empty : *found;
}

/// A neighbour and up to three of the materials around the edge to it.
struct EdgeMaterials {
  VertexId vertex;
  int count;
  std::array<MaterialId, 3> materials;

  void add(MaterialId m) {
    for (int i = 0; i < count; ++i) {
      if (materials[static_cast<std::size_t>(i)] == m) return;
    }
    if (count < 3) materials[static_cast<std::size_t>(count++)] = m;
  }
};

constexpr std::int64_t kBlock = 4096;

}  // namespace

template <int Dim>
VertexCells::VertexCells(const CellBlock& simplices, const Points<Dim>& points)
    : first_(points.size() + 1, 0), cells_(simplices.vertices.size()) {
  if (simplices.size() > 0xffffffffLL) {
    throw Error(ErrorKind::limits, "smooth: more than 2^32 - 1 cells; choose larger cells");
  }
  for (const VertexId v : simplices.vertices) ++first_[v];
  exclusive_scan(std::span(first_));
  for (std::int64_t c = 0; c < simplices.size(); ++c) {
    for (int k = 0; k <= Dim; ++k) cells_[first_[simplices.cell(c)[k]]++] = static_cast<std::uint32_t>(c);
  }
  // Each entry has moved on to where the next vertex begins.
  std::move_backward(first_.begin(), first_.end() - 1, first_.end());
  first_[0] = 0;
}

template <int Dim>
Strata<Dim>::Strata(const Mesh<Dim>& mesh, const Execution& execution)
    : mesh_(mesh),
      simplices_(find_simplices(mesh.blocks, kSimplex<Dim>)),
      cells_(simplices_, mesh.points),
      faces_(mesh.points.size(), 0),
      subset_(mesh.points.size(), Subset::fixed) {
  find_faces(execution);
  classify(execution);
}

template <int Dim>
void Strata<Dim>::find_faces(const Execution& execution) {
  if (mesh_.points.empty()) return;
  Vec<Dim> low = mesh_.points[0];
  Vec<Dim> high = low;
  for (const Vec<Dim>& x : mesh_.points) {
    for (int d = 0; d < Dim; ++d) {
      low[d] = std::min(low[d], x[d]);
      high[d] = std::max(high[d], x[d]);
    }
  }
  parallel_for(execution, static_cast<std::int64_t>(faces_.size()), kBlock, [&](std::int64_t v) {
    const Vec<Dim>& x = mesh_.points[static_cast<std::size_t>(v)];
    unsigned faces = 0;
    for (int d = 0; d < Dim; ++d) {
      faces |= static_cast<unsigned>(x[d] == low[d]) << d;
      faces |= static_cast<unsigned>(x[d] == high[d]) << (Dim + d);
    }
    faces_[static_cast<std::size_t>(v)] = static_cast<std::uint8_t>(faces);
  });
}

template <int Dim>
void Strata<Dim>::classify(const Execution& execution) {
  parallel_for(execution, static_cast<std::int64_t>(subset_.size()), kBlock, [&](std::int64_t i) {
    const auto v = static_cast<VertexId>(i);
    if (cells_[v].empty()) return;
    EdgeMaterials around{v, 0, {}};
    for (const std::uint32_t c : cells_[v]) around.add(simplices_.materials[c]);
    const int left = Dim - std::popcount(pinned(v)) - (around.count - 1);
    if (left < 1) return;
    subset_[v] = around.count == 1 ? Subset::volume : around.count == 2 ? Subset::interface : Subset::curve;
  });
  for (const CellBlock& block : mesh_.blocks) {
    if (block.type == kSimplex<Dim>) continue;
    for (const VertexId v : block.vertices) subset_[v] = Subset::fixed;
  }
}

template <int Dim>
bool Strata<Dim>::append_neighbours(VertexId v, std::vector<VertexId>& out) const {
  thread_local std::vector<EdgeMaterials> edges;
  edges.clear();
  for (const std::uint32_t c : cells_[v]) {
    for (int k = 0; k <= Dim; ++k) {
      const VertexId w = simplices_.cell(c)[k];
      if (w == v || (faces_[v] & ~faces_[w]) != 0) continue;
      auto edge = std::ranges::find(edges, w, &EdgeMaterials::vertex);
      if (edge == edges.end()) edge = edges.insert(edge, {w, 0, {}});
      edge->add(simplices_.materials[c]);
    }
  }
  // Materials around an edge of the subset: as many as around the vertex.
  const int needed = subset_[v] == Subset::volume ? 1 : subset_[v] == Subset::interface ? 2 : 3;
  const std::size_t begin = out.size();
  for (const EdgeMaterials& edge : edges) {
    if (edge.count >= needed) out.push_back(edge.vertex);
  }
  std::sort(out.begin() + static_cast<std::ptrdiff_t>(begin), out.end());
  const std::size_t count = out.size() - begin;
  const int left = Dim - std::popcount(pinned(v)) - (needed - 1);
  if (left == 1 ? count == 2 : count > 2) return true;
  out.resize(begin);
  return false;
}

template <int Dim>
SubsetGraph Strata<Dim>::graph(Subset subset, const Execution& execution) const {
  struct Part {
    std::vector<VertexId> vertices, neighbours;
    std::vector<std::uint64_t> ends;
  };
  const auto points = static_cast<std::int64_t>(subset_.size());
  std::vector<Part> parts(static_cast<std::size_t>(block_count(points, kBlock)));
  parallel_for(execution, static_cast<std::int64_t>(parts.size()), 1, [&](std::int64_t b) {
    Part& part = parts[static_cast<std::size_t>(b)];
    for (std::int64_t v = b * kBlock; v < std::min(points, (b + 1) * kBlock); ++v) {
      if (subset_[static_cast<std::size_t>(v)] != subset) continue;
      if (!append_neighbours(static_cast<VertexId>(v), part.neighbours)) continue;
      part.vertices.push_back(static_cast<VertexId>(v));
      part.ends.push_back(part.neighbours.size());
    }
  });
  SubsetGraph graph;
  graph.first.push_back(0);
  for (Part& part : parts) {
    const std::uint64_t begin = graph.neighbours.size();
    graph.vertices.insert(graph.vertices.end(), part.vertices.begin(), part.vertices.end());
    graph.neighbours.insert(graph.neighbours.end(), part.neighbours.begin(), part.neighbours.end());
    for (const std::uint64_t end : part.ends) graph.first.push_back(begin + end);
    part = {};
  }
  find_blocks(graph, execution);
  return graph;
}

/// The largest distance along each axis between two vertices of the graph that share a cell.
template <int Dim>
Vec<Dim> Strata<Dim>::widest_pair(const SubsetGraph& graph, const Execution& execution) const {
  std::vector<std::uint8_t> member(subset_.size(), 0);
  for (const VertexId v : graph.vertices) member[v] = 1;
  return parallel_reduce(
      execution, simplices_.size(), kBlock, Vec<Dim>{},
      [&](std::int64_t begin, std::int64_t end) {
        Vec<Dim> widest{};
        for (std::int64_t c = begin; c < end; ++c) {
          const VertexId* cell = simplices_.cell(c);
          for (int a = 0; a <= Dim; ++a) {
            for (int b = 0; b < a && member[cell[a]]; ++b) {
              if (!member[cell[b]]) continue;
              const Vec<Dim> apart = mesh_.points[cell[a]] - mesh_.points[cell[b]];
              for (int d = 0; d < Dim; ++d) widest[d] = std::max(widest[d], std::abs(apart[d]));
            }
          }
        }
        return widest;
      },
      [](Vec<Dim> a, const Vec<Dim>& b) {
        for (int d = 0; d < Dim; ++d) a[d] = std::max(a[d], b[d]);
        return a;
      });
}

/// Blocks are boxes of a grid, wider than any two vertices that share a cell are apart; their colour is the parity of
/// their place. So there are few colours, and the vertices that are treated one after the other lie together. Within a
/// block they are scattered: in the order of space a sweep would drag the surface along (measured: 8.9 instead of 8.8
/// degrees off a ball).
template <int Dim>
void Strata<Dim>::find_blocks(SubsetGraph& graph, const Execution& execution) const {
  constexpr double kPerBlock = 2000;  // vertices: their cells fit a cache
  graph.blocks = graph.colours = {0};
  if (graph.vertices.empty()) return;
  Vec<Dim> low = mesh_.points[graph.vertices[0]], high = low;
  for (const VertexId v : graph.vertices) {
    for (int d = 0; d < Dim; ++d) {
      low[d] = std::min(low[d], mesh_.points[v][d]);
      high[d] = std::max(high[d], mesh_.points[v][d]);
    }
  }
  const double extent = norm(high - low) / std::sqrt(Dim);
  const double side = extent / std::pow(static_cast<double>(graph.vertices.size()) / kPerBlock + 1, 1.0 / Dim);
  const Vec<Dim> widest = widest_pair(graph, execution);
  Coord<Dim> count;
  Vec<Dim> width;
  for (int d = 0; d < Dim; ++d) {
    width[d] = std::max({side, widest[d] * (1 + 1e-6), (high[d] - low[d]) / 1000});
    count[d] = width[d] > 0 ? static_cast<std::int32_t>((high[d] - low[d]) / width[d]) + 1 : 1;
  }
  struct Place {
    std::uint64_t block;  // colour first
    std::uint32_t hash, position;
    bool operator<(const Place& other) const {
      return std::tie(block, hash, position) < std::tie(other.block, other.hash, other.position);
    }
  };
  std::vector<Place> places(graph.vertices.size());
  parallel_for(execution, static_cast<std::int64_t>(places.size()), kBlock, [&](std::int64_t i) {
    Coord<Dim> at;
    std::uint64_t colour = 0;
    for (int d = 0; d < Dim; ++d) {
      const double x = mesh_.points[graph.vertices[static_cast<std::size_t>(i)]][d] - low[d];
      at[d] = width[d] > 0 ? static_cast<std::int32_t>(x / width[d]) : 0;
      colour |= static_cast<std::uint64_t>(at[d] & 1) << d;
    }
    places[static_cast<std::size_t>(i)] = {colour << 32 | static_cast<std::uint64_t>(linear_index(at, count)),
                                           static_cast<std::uint32_t>(i) * 2654435761U, static_cast<std::uint32_t>(i)};
  });
  parallel_sort(execution, places);
  graph.by_block.reserve(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (i > 0 && places[i].block != places[i - 1].block) {
      graph.blocks.push_back(static_cast<std::uint32_t>(i));
      if (places[i].block >> 32 != places[i - 1].block >> 32) {
        graph.colours.push_back(static_cast<std::uint32_t>(graph.blocks.size()) - 1);
      }
    }
    graph.by_block.push_back(places[i].position);
  }
  graph.blocks.push_back(static_cast<std::uint32_t>(places.size()));
  graph.colours.push_back(static_cast<std::uint32_t>(graph.blocks.size()) - 1);
}

template VertexCells::VertexCells(const CellBlock&, const Points<2>&);
template VertexCells::VertexCells(const CellBlock&, const Points<3>&);
template class Strata<2>;
template class Strata<3>;

}  // namespace treemarch
