#include "treemarch/report/mesh_components.h"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <span>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/facets.h"

// Most vertices lie inside one material: all cells around such a vertex belong to one component, so the vertex can
// stand for them, and no facet that contains it needs to be matched. What is left are the facets whose vertices all lie
// on interfaces or on the hull.

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerTask = 1 << 13;
constexpr MaterialId kUnused = kOutside;

/// Disjoint sets that several threads may join at once. The roots are the smallest members whatever the order.
class SharedDisjointSets {
 public:
  using Index = std::uint32_t;
  explicit SharedDisjointSets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), Index{0}); }

  Index find(Index i) {
    while (true) {
      Index up = at(i).load(std::memory_order_relaxed);
      if (up == i) return i;
      const Index above = at(up).load(std::memory_order_relaxed);
      if (above != up) at(i).compare_exchange_weak(up, above, std::memory_order_relaxed);
      i = above;
    }
  }
  void join(Index a, Index b) {
    while (true) {
      a = find(a);
      b = find(b);
      if (a == b) return;
      Index root = std::max(a, b);
      if (at(root).compare_exchange_strong(root, std::min(a, b), std::memory_order_relaxed)) return;
    }
  }
  [[nodiscard]] bool is_root(Index i) const { return parent_[i] == i; }

 private:
  std::atomic_ref<Index> at(Index i) { return std::atomic_ref(parent_[i]); }
  std::vector<Index> parent_;
};

/// A bijection that scatters its argument (the finaliser of SplitMix64).
std::uint64_t scatter(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

/// Calls f(block index, cell) for all cells of a mesh, in parallel.
template <int Dim, class F>
void for_each_cell(const Mesh<Dim>& mesh, const Execution& execution, F&& f) {
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
    parallel_for(execution, mesh.blocks[b].size(), kCellsPerTask, [&](std::int64_t c) { f(b, c); });
}

/// One a vertex: 0 where all cells around it are of one material and close around it, else 1.
///
/// Each vertex adds up (xor) a hash of each of its facets and of the material behind it. Facets between two cells of
/// one material cancel, all others stay.
template <int Dim>
std::vector<std::uint8_t> find_border_vertices(const Mesh<Dim>& mesh, const Execution& execution) {
  std::vector<std::uint64_t> sums(mesh.points.size());
  for_each_cell(mesh, execution, [&](std::size_t b, std::int64_t c) {
    const CellBlock& block = mesh.blocks[b];
    const VertexId* v = block.cell(c);
    const int n = vertex_count(block.type);
    const CellTopology& shape = topology(block.type);
    std::array<std::uint64_t, 8> hash{}, sum{};
    for (int i = 0; i < n; ++i) hash[i] = scatter(v[i]);
    for (int k = 0; k < shape.facet_count; ++k) {
      const LocalFacet& facet = shape.facets[k];
      std::uint64_t h = block.materials[static_cast<std::size_t>(c)];
      for (int i = 0; i < facet.size; ++i) h += hash[facet.vertex[i]];
      h = scatter(h);
      for (int i = 0; i < facet.size; ++i) sum[facet.vertex[i]] ^= h;
    }
    for (int i = 0; i < n; ++i) std::atomic_ref(sums[v[i]]).fetch_xor(sum[i], std::memory_order_relaxed);
  });
  std::vector<std::uint8_t> border(sums.size());
  parallel_for(execution, std::ssize(sums), 1 << 16,
               [&](std::int64_t v) { border[static_cast<std::size_t>(v)] = sums[static_cast<std::size_t>(v)] != 0; });
  return border;
}

/// The parts of a mesh that are joined: its inner vertices, and after them its cells, of which those count that have no
/// inner vertex.
template <int Dim>
class Parts {
 public:
  using Index = SharedDisjointSets::Index;

  Parts(const Mesh<Dim>& mesh, const std::vector<std::uint8_t>& border) : mesh_(mesh), border_(border) {
    std::size_t n = mesh.points.size();
    for (const CellBlock& block : mesh.blocks) {
      first_cell_.push_back(n);
      n += block.materials.size();
    }
    count_ = n;
  }
  [[nodiscard]] std::size_t size() const { return count_; }

  /// The part that a cell belongs to.
  [[nodiscard]] Index of(std::size_t block, std::int64_t cell) const {
    const VertexId* v = mesh_.blocks[block].cell(cell);
    for (int i = 0; i < vertex_count(mesh_.blocks[block].type); ++i)
      if (border_[v[i]] == 0) return v[i];
    return static_cast<Index>(first_cell_[block] + static_cast<std::size_t>(cell));
  }
  [[nodiscard]] bool is_cell(Index part) const { return part >= mesh_.points.size(); }

 private:
  const Mesh<Dim>& mesh_;
  const std::vector<std::uint8_t>& border_;
  std::vector<std::size_t> first_cell_;  // per block
  std::size_t count_ = 0;
};

}  // namespace

template <int Dim>
std::vector<std::int64_t> count_mesh_components(const Mesh<Dim>& mesh, const Execution& execution) {
  const std::vector<std::uint8_t> border = find_border_vertices(mesh, execution);
  const Parts<Dim> parts(mesh, border);
  SharedDisjointSets sets(parts.size());
  const auto material = [&](std::size_t b, std::int64_t c) {
    return mesh.blocks[b].materials[static_cast<std::size_t>(c)];
  };

  std::vector<MaterialId> material_of_vertex(mesh.points.size(), kUnused);
  for_each_cell(mesh, execution, [&](std::size_t b, std::int64_t c) {
    const VertexId* v = mesh.blocks[b].cell(c);
    const auto part = parts.of(b, c);
    if (parts.is_cell(part)) return;
    std::atomic_ref(material_of_vertex[part]).store(material(b, c), std::memory_order_relaxed);
    for (int i = 0; i < vertex_count(mesh.blocks[b].type); ++i)
      if (border[v[i]] == 0) sets.join(part, v[i]);
  });
  visit_facets(
      mesh, execution,
      [&](std::int64_t, std::span<const FacetSide> sides) {
        for (std::size_t i = 1; i < sides.size(); ++i)
          if (material(sides[i].block, sides[i].cell) == material(sides[0].block, sides[0].cell))
            sets.join(parts.of(sides[0].block, sides[0].cell), parts.of(sides[i].block, sides[i].cell));
      },
      border);

  std::vector<std::int64_t> count(mesh.labels.size());
  // A root is the smallest member of its component, and the first inner vertex of the cells around it.
  for (std::size_t v = 0; v < border.size(); ++v)
    if (material_of_vertex[v] != kUnused && sets.is_root(static_cast<VertexId>(v))) ++count[material_of_vertex[v]];
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    for (std::int64_t c = 0; c < mesh.blocks[b].size(); ++c) {
      const auto part = parts.of(b, c);
      if (parts.is_cell(part) && sets.is_root(part)) ++count[material(b, c)];
    }
  }
  return count;
}

template std::vector<std::int64_t> count_mesh_components(const Mesh<2>&, const Execution&);
template std::vector<std::int64_t> count_mesh_components(const Mesh<3>&, const Execution&);

}  // namespace treemarch
