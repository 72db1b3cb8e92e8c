#include "treemarch/mesh/facets.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <span>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"

namespace treemarch {
namespace {

constexpr std::int64_t kVerticesPerPart = 4096;
constexpr std::int64_t kCellsPerTask = 8192;
constexpr std::uint32_t kFacetsPerPass = 16U << 20U;
constexpr VertexId kNoVertex = 0xffffffffU;  // fills up the key of a triangle where there are quads

/// A facet without its smallest vertex, which is implied by the bucket that holds it. Facets are numbered through all
/// blocks.
template <int Rest>
struct Entry {
  std::array<VertexId, Rest> rest;
  std::uint32_t facet;
  bool operator<(const Entry& other) const {
    if constexpr (Rest == 2) {  // most meshes; in one go, as which of them differs cannot be foreseen
      const std::uint64_t a = std::uint64_t{rest[0]} << 32U | rest[1];
      const std::uint64_t b = std::uint64_t{other.rest[0]} << 32U | other.rest[1];
      return (a < b) | ((a == b) & (facet < other.facet));
    }
    for (int i = 0; i < Rest; ++i)
      if (rest[i] != other.rest[i]) return rest[i] < other.rest[i];
    return facet < other.facet;
  }
};

/// Vertices of a facet in ascending order, filled up with kNoVertex.
template <int Rest>
std::array<VertexId, Rest + 1> sorted_vertices(const LocalFacet& facet, const VertexId* cell) {
  if constexpr (Rest == 0) return {cell[facet.vertex[0]]};
  std::array<VertexId, Rest + 1> v;
  v.fill(kNoVertex);
  for (int i = 0; i < facet.size; ++i) {
    int j = i;
    for (const VertexId x = cell[facet.vertex[i]];; --j) {
      if (j == 0 || v[j - 1] < x) {
        v[j] = x;
        break;
      }
      v[j] = v[j - 1];
    }
  }
  return v;
}

template <int Dim, int Rest>
class Sorter {
 public:
  Sorter(const Mesh<Dim>& mesh, const Execution& execution, const FacetFilter& filter)
      : mesh_(mesh), execution_(execution), filter_(filter) {
    std::uint64_t facets = 0;
    for (const CellBlock& block : mesh.blocks) {
      first_facet_.push_back(static_cast<std::uint32_t>(facets));
      facets += static_cast<std::uint64_t>(block.size()) * topology(block.type).facet_count;
      if (facets >= kNoVertex) throw Error(ErrorKind::limits, "mesh: more than 2^32 facets; choose larger cells");
    }
    counts_.resize(mesh.points.size());
    count();
  }

  template <class Visit>
  void run(const Visit& visit) {
    const auto vertices = static_cast<std::int64_t>(counts_.size());
    for (std::int64_t begin = 0; begin < vertices;) {
      // Whole parts up to the memory of a pass, one at least.
      std::int64_t end = begin;
      std::uint64_t facets = 0;
      while (end < vertices && (end == begin || facets < kFacetsPerPass)) {
        const std::int64_t next = std::min(vertices, end + kVerticesPerPart);
        for (; end < next; ++end) facets += counts_[end];
      }
      pass(begin, end, visit);
      begin = end;
    }
  }

 private:
  /// Cells that are looked at one after the other.
  struct Task {
    std::size_t block;
    std::int64_t begin;                 // cell
    std::vector<std::uint16_t> wanted;  // where there is a filter: cells after it that may have a facet in question
  };

  /// Facets by their smallest vertex; notes the cells that have some.
  void count() {
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
      for (std::int64_t c = b == 0 ? filter_.first_cell : 0; c < mesh_.blocks[b].size(); c += kCellsPerTask)
        tasks_.push_back({b, c, {}});
    parallel_for(execution_, std::ssize(tasks_), 1, [&](std::int64_t t) {
      Task& task = tasks_[static_cast<std::size_t>(t)];
      const CellBlock& block = mesh_.blocks[task.block];
      for (std::int64_t c = task.begin; c < std::min(block.size(), task.begin + kCellsPerTask); ++c) {
        if (!may_be_wanted(block, c)) continue;
        if (!filter_.among.empty()) task.wanted.push_back(static_cast<std::uint16_t>(c - task.begin));
        for_facets_of(task.block, c, [&](const auto& v, std::uint32_t) {
          std::atomic_ref(counts_[v[0]]).fetch_add(1, std::memory_order_relaxed);
        });
      }
    });
  }

  template <class Use>
  void for_each_facet(const Use& use) const {
    parallel_for(execution_, std::ssize(tasks_), 1, [&](std::int64_t t) {
      const Task& task = tasks_[static_cast<std::size_t>(t)];
      if (filter_.among.empty())
        for (std::int64_t c = task.begin; c < std::min(mesh_.blocks[task.block].size(), task.begin + kCellsPerTask);
             ++c)
          for_facets_of(task.block, c, use);
      for (const std::uint16_t c : task.wanted) for_facets_of(task.block, task.begin + c, use);
    });
  }

  template <class Use>
  void for_facets_of(std::size_t b, std::int64_t c, const Use& use) const {
    const CellBlock& block = mesh_.blocks[b];
    const CellTopology& shape = topology(block.type);
    for (int f = 0; f < shape.facet_count; ++f) {
      if (!is_wanted(shape.facets[f], block.cell(c))) continue;
      use(sorted_vertices<Rest>(shape.facets[f], block.cell(c)),
          first_facet_[b] + static_cast<std::uint32_t>(c * shape.facet_count + f));
    }
  }

  [[nodiscard]] bool may_be_wanted(const CellBlock& block, std::int64_t c) const {
    if (filter_.among.empty()) return true;
    const VertexId* v = block.cell(c);
    int wanted = 0;
    for (int k = 0; k < vertex_count(block.type); ++k) wanted += filter_.among[v[k]] != 0;
    return wanted >= Dim;
  }
  [[nodiscard]] bool is_wanted(const LocalFacet& facet, const VertexId* cell) const {
    if (filter_.among.empty()) return true;
    for (int i = 0; i < facet.size; ++i)
      if (filter_.among[cell[facet.vertex[i]]] == 0) return false;
    return true;
  }

  /// All facets whose smallest vertex is in [begin, end).
  template <class Visit>
  void pass(std::int64_t begin, std::int64_t end, const Visit& visit) {
    std::vector<std::uint32_t> cursor(counts_.begin() + begin, counts_.begin() + end);
    entries_.resize(exclusive_scan(std::span(cursor)));
    for_each_facet([&](const auto& v, std::uint32_t facet) {
      if (v[0] < begin || v[0] >= end) return;
      Entry<Rest>& entry = entries_[std::atomic_ref(cursor[v[0] - begin]).fetch_add(1, std::memory_order_relaxed)];
      std::copy(v.begin() + 1, v.end(), entry.rest.begin());
      entry.facet = facet;
    });
    // Each cursor now stands at the end of its bucket.
    parallel_for(execution_, block_count(end - begin, kVerticesPerPart), 1, [&](std::int64_t p) {
      const std::int64_t last = std::min(end - begin, (p + 1) * kVerticesPerPart);
      std::vector<FacetSide> sides;
      for (std::int64_t v = p * kVerticesPerPart; v < last; ++v)
        visit_bucket(begin / kVerticesPerPart + p,
                     std::span(entries_).subspan(v ? cursor[v - 1] : 0, counts_[begin + v]), sides, visit);
    });
  }

  template <class Visit>
  void visit_bucket(std::int64_t part, std::span<Entry<Rest>> bucket, std::vector<FacetSide>& sides,
                    const Visit& visit) const {
    // Threads filled the bucket in any order; the facet number makes this order total.
    std::sort(bucket.begin(), bucket.end());
    for (std::size_t i = 0; i < bucket.size();) {
      sides.clear();
      const std::size_t first = i;
      for (; i < bucket.size() && bucket[i].rest == bucket[first].rest; ++i) sides.push_back(side(bucket[i].facet));
      visit(part, std::span<const FacetSide>(sides));
    }
  }

  FacetSide side(std::uint32_t facet) const {
    std::size_t b = first_facet_.size() - 1;
    while (first_facet_[b] > facet) --b;
    const auto per_cell = static_cast<std::uint32_t>(topology(mesh_.blocks[b].type).facet_count);
    const std::uint32_t local = facet - first_facet_[b];
    if (per_cell == 4) return {local / 4, b, local % 4};
    return {local / per_cell, b, local % per_cell};
  }

  const Mesh<Dim>& mesh_;
  const Execution& execution_;
  FacetFilter filter_;
  std::vector<Task> tasks_;
  std::vector<std::uint32_t> first_facet_;  // per block
  std::vector<std::uint32_t> counts_;       // facets by smallest vertex
  RawVector<Entry<Rest>> entries_;
};

}  // namespace

std::int64_t facet_part_count(std::int64_t points) { return block_count(points, kVerticesPerPart); }

template <int Dim>
void visit_facets(const Mesh<Dim>& mesh, const Execution& execution,
                  const std::function<void(std::int64_t part, std::span<const FacetSide> sides)>& visit,
                  const FacetFilter& filter) {
  if constexpr (Dim == 3) {
    for (const CellBlock& block : mesh.blocks)
      if (block.type != CellType::tetrahedron) return Sorter<Dim, 3>(mesh, execution, filter).run(visit);
  }
  Sorter<Dim, Dim - 1>(mesh, execution, filter).run(visit);
}

using Visitor = std::function<void(std::int64_t, std::span<const FacetSide>)>;
template void visit_facets(const Mesh<1>&, const Execution&, const Visitor&, const FacetFilter&);
template void visit_facets(const Mesh<2>&, const Execution&, const Visitor&, const FacetFilter&);
template void visit_facets(const Mesh<3>&, const Execution&, const Visitor&, const FacetFilter&);
template void visit_facets(const Mesh<4>&, const Execution&, const Visitor&, const FacetFilter&);

}  // namespace treemarch
