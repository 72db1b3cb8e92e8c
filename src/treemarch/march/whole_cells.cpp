#include "treemarch/march/whole_cells.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/march/band.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/material_mark.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 1 << 14;  // cells
constexpr CellType kBoxTypes[] = {CellType::line, CellType::line, CellType::quad, CellType::hexahedron};

template <int Dim>
class WholeCells {
 public:
  WholeCells(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, const WholeCellOptions& options, Execution& execution)
      : mesh_(mesh),
        cells_(mesh.blocks[0]),
        lattice_(lattice),
        options_(options),
        execution_(execution),
        leaf_of_(lattice.vertices.size(), kNoLeaf),
        faces_(lattice.leaves.size()),
        box_(lattice.leaves.size(), kOutside),
        gone_(static_cast<std::size_t>(cells_.size())) {}

  void run() {
    find_owners();
    for_leaves([&](LeafId leaf) { find_whole_faces(leaf); });
    for_leaves([&](LeafId leaf) { find_opened(leaf); });
    for_leaves([&](LeafId leaf) { check_box(leaf); });
    write();
  }

 private:
  using Star = LeafStar<Dim>;
  using Simplex = typename Star::Simplex;
  using Pyramid = std::array<VertexId, 5>;
  using Counts = std::array<std::int64_t, 2>;  // pyramids, boxes
  template <std::size_t N>
  static constexpr std::size_t kKind = N == 5 ? 0 : 1;

  template <class Visit>
  void for_leaves(Visit&& visit) const {
    parallel_for(execution_, std::ssize(lattice_.leaves), kLeavesPerBlock,
                 [&](std::int64_t leaf) { visit(static_cast<LeafId>(leaf)); });
  }
  [[nodiscard]] std::int32_t side_of(LeafId leaf) const { return lattice_.sides[lattice_.leaves[leaf].level]; }
  [[nodiscard]] LeafId owner_of(const VertexId* v) const;
  [[nodiscard]] LeafId owner_beside(LeafId leaf, const std::array<VertexId, Dim + 1>& cell, int centre) const;
  void find_owners();
  void find_whole_faces(LeafId leaf);
  [[nodiscard]] bool on_hull(const Star& star, int face) const {
    const std::int32_t at = lattice_.vertices[star.across[face]][face / 2];
    return at == 0 || at == lattice_.extent[face / 2];
  }
  template <std::size_t N>
  [[nodiscard]] bool is_good(CellType type, const std::array<VertexId, N>& cell) const;
  [[nodiscard]] std::array<Pyramid, 2> pyramids(const Star& star, int face) const;
  void find_opened(LeafId leaf);
  void check_box(LeafId leaf);
  [[nodiscard]] bool is_box(LeafId leaf) const { return box_[leaf] != kSeveral; }
  template <class Visit>
  void for_new_cells(LeafId leaf, Visit&& visit) const;
  void write();

  Mesh<Dim>& mesh_;
  const CellBlock& cells_;
  const SimplexLattice<Dim>& lattice_;
  const WholeCellOptions& options_;
  Execution& execution_;
  std::vector<LeafId> leaf_of_;       // whose centre a vertex of the lattice is
  std::vector<std::int64_t> first_;   // of each leaf: into owned_
  std::vector<std::uint32_t> owned_;  // the cells that may be simplices of the leaf
  std::vector<std::array<MaterialId, 2 * Dim>>
      faces_;                       // of the faces that a leaf makes and that are whole, or kOutside
  std::vector<MaterialId> box_;     // of each leaf, kSeveral where it is no box
  std::vector<std::uint8_t> gone_;  // simplices that whole cells replace
};

/// The leaf whose simplex a cell is, if it is one of the lattice at all; kNoLeaf where it is surely not.
template <int Dim>
LeafId WholeCells<Dim>::owner_of(const VertexId* v) const {
  std::array<VertexId, Dim + 1> cell;
  LeafId found = kNoLeaf;
  int centre = 0;
  for (int k = 0; k <= Dim; ++k) {
    cell[k] = v[k];
    if (v[k] >= lattice_.vertices.size()) return kNoLeaf;
    const LeafId leaf = leaf_of_[v[k]];
    if (leaf == kNoLeaf) continue;
    // Between two leaves of one size the lower one makes the simplices.
    if (found == kNoLeaf || lattice_.leaves[leaf].corner < lattice_.leaves[found].corner) centre = k;
    if (found != kNoLeaf) return leaf_of_[v[centre]];
    found = leaf;
  }
  if constexpr (Dim == 2)
    return found;
  else
    return found == kNoLeaf ? kNoLeaf : owner_beside(found, cell, centre);
}

/// The same where one vertex alone is the centre of a leaf: the others are on a face of this leaf, or on one of a
/// smaller leaf beside it.
template <int Dim>
LeafId WholeCells<Dim>::owner_beside(LeafId leaf, const std::array<VertexId, Dim + 1>& cell, int centre) const {
  const std::int32_t side = side_of(leaf);
  Coord<Dim> low{}, high{};
  bool first = true;
  for (int k = 0; k <= Dim; ++k) {
    if (k == centre) continue;
    const Coord<Dim>& at = lattice_.vertices[cell[k]];
    for (int d = 0; d < Dim; ++d) {
      low[d] = first ? at[d] : std::min(low[d], at[d]);
      high[d] = first ? at[d] : std::max(high[d], at[d]);
    }
    first = false;
  }
  Coord<Dim> beside{};
  bool smaller = true;
  for (int d = 0; d < Dim; ++d) {
    const std::int32_t from = lattice_.vertices[cell[centre]][d];
    smaller &= high[d] - low[d] <= side;
    beside[d] = low[d] == high[d] ? low[d] + (low[d] - from) / 2 : (low[d] + high[d]) / 2;
    if (beside[d] < 0 || beside[d] > lattice_.extent[d]) return leaf;
  }
  if (!smaller || !lattice_.points.contains(beside)) return leaf;
  return leaf_of_[lattice_.points.id(beside)];
}

template <int Dim>
void WholeCells<Dim>::find_owners() {
  for_leaves([&](LeafId leaf) {
    Coord<Dim> centre{};
    for (int d = 0; d < Dim; ++d) centre[d] = 2 * lattice_.leaves[leaf].corner[d] + side_of(leaf);
    leaf_of_[lattice_.points.id(centre)] = leaf;
  });
  std::vector<LeafId> owner(static_cast<std::size_t>(cells_.size()));
  first_.assign(lattice_.leaves.size() + 1, 0);
  parallel_for(execution_, cells_.size(), kGrain, [&](std::int64_t c) {
    owner[c] = owner_of(cells_.cell(c));
    if (owner[c] != kNoLeaf) std::atomic_ref(first_[owner[c]]).fetch_add(1, std::memory_order_relaxed);
  });
  owned_.resize(static_cast<std::size_t>(exclusive_scan(std::span(first_))));
  std::vector<std::int64_t> next = first_;
  parallel_for(execution_, cells_.size(), kGrain, [&](std::int64_t c) {
    if (owner[c] == kNoLeaf) return;
    owned_[std::atomic_ref(next[owner[c]]).fetch_add(1, std::memory_order_relaxed)] = static_cast<std::uint32_t>(c);
  });
}

template <int Dim>
template <std::size_t N>
bool WholeCells<Dim>::is_good(CellType type, const std::array<VertexId, N>& cell) const {
  std::array<Vec<Dim>, 8> p{};
  for (std::size_t k = 0; k < N; ++k) p[k] = mesh_.points[cell[k]];
  if (!(corner_jacobians<Dim>(p, type).min_scaled >= options_.jacobian)) return false;
  const DegreeRange angles = cell_angles<Dim>(mesh_.points.data(), type, cell.data());
  constexpr double kDegree = std::numbers::pi / 180;
  return quality({std::cos(kDegree * angles.min), std::cos(kDegree * angles.max)}) >= options_.quality;
}

/// Over a face: that of the leaf itself, then that of the leaf across. \pre Dim is 3
template <int Dim>
std::array<std::array<VertexId, 5>, 2> WholeCells<Dim>::pyramids(const Star& star, int face) const {
  const auto rim = star.rim(face);
  const auto pyramid = [&](VertexId apex, bool above) {
    return above ? Pyramid{rim[0], rim[1], rim[2], rim[3], apex} : Pyramid{rim[0], rim[3], rim[2], rim[1], apex};
  };
  const bool up = face % 2 != 0;
  return {pyramid(star.centre, !up), pyramid(star.across[face], up)};
}

template <int Dim>
void WholeCells<Dim>::find_whole_faces(LeafId leaf) {
  std::array<MaterialId, 2 * Dim>& faces = faces_[leaf];
  faces.fill(kOutside);
  std::vector<std::pair<Simplex, std::uint32_t>> there;
  for (std::int64_t i = first_[leaf]; i < first_[leaf + 1]; ++i) {
    Simplex s;
    std::copy_n(cells_.cell(owned_[i]), Dim + 1, s.begin());
    std::ranges::sort(s);
    there.push_back({s, owned_[i]});
  }
  if (there.empty()) return;
  std::ranges::sort(there);
  const Star star = lattice_.star(leaf);
  std::array<Simplex, Star::kMostSimplices> listed;
  std::array<std::uint32_t, Star::kMostSimplices> found;
  int total = 0;
  for (int face = 0; face < Star::kFaces; ++face) {
    const int count = star.simplices(face, listed);
    if (count == 0 || star.is_halved(face)) continue;
    MaterialId material = kOutside;
    int same = 0;
    for (int i = 0; i < count; ++i) {
      std::ranges::sort(listed[i]);
      const auto at = std::ranges::lower_bound(there, listed[i], {}, &std::pair<Simplex, std::uint32_t>::first);
      if (at == there.end() || at->first != listed[i]) break;
      found[total + i] = at->second;
      if (i == 0) material = cells_.materials[at->second];
      same += cells_.materials[at->second] == material;
    }
    if (same < count) continue;
    if constexpr (Dim == 3) {
      const auto [own, beyond] = pyramids(star, face);
      if (!is_good(CellType::pyramid, own)) continue;
      if (!on_hull(star, face) && !is_good(CellType::pyramid, beyond)) continue;
    }
    faces[face] = material;
    total += count;
  }
  if constexpr (Dim == 2)  // all four sides or none
    if (std::ranges::count(faces, faces[0]) < Star::kFaces || !is_good(kBoxTypes[Dim], star.box())) {
      faces.fill(kOutside);
      total = 0;
    }
  for (int i = 0; i < total; ++i) gone_[found[i]] = 1;
}

/// Leaves whose faces are not all whole and of one material are no boxes.
template <int Dim>
void WholeCells<Dim>::find_opened(LeafId leaf) {
  const Star star = lattice_.star(leaf);
  for (int face = 0; face < Star::kFaces; ++face) {
    if (Dim == 3 && star.across[face] == Star::kNone) continue;
    const MaterialId material = faces_[leaf][face] == kOutside ? kSeveral : faces_[leaf][face];
    note_material(box_[leaf], material);
    if constexpr (Dim == 3) {
      if (on_hull(star, face)) continue;
      const bool larger = (star.split >> face & 1) != 0;  // has smaller ones beside it
      note_material(box_[leaf_of_[star.across[face]]], larger ? kSeveral : material);
    }
  }
}

template <int Dim>
void WholeCells<Dim>::check_box(LeafId leaf) {
  if (is_box(leaf) && !is_good(kBoxTypes[Dim], lattice_.star(leaf).box())) box_[leaf] = kSeveral;
}

/// Calls visit(cell, material) for the pyramids and boxes of a leaf and of the faces that it makes.
template <int Dim>
template <class Visit>
void WholeCells<Dim>::for_new_cells(LeafId leaf, Visit&& visit) const {
  const bool any_face = std::ranges::any_of(faces_[leaf], [](MaterialId m) { return m != kOutside; });
  if (!is_box(leaf) && !any_face) return;
  const Star star = lattice_.star(leaf);
  if (is_box(leaf)) visit(star.box(), box_[leaf]);
  if constexpr (Dim == 3) {
    for (int face = 0; face < Star::kFaces; ++face) {
      const MaterialId material = faces_[leaf][face];
      if (material == kOutside) continue;
      const auto [own, beyond] = pyramids(star, face);
      if (!is_box(leaf)) visit(own, material);
      if (!on_hull(star, face) && !is_box(leaf_of_[star.across[face]])) visit(beyond, material);
    }
  }
}

template <int Dim>
void WholeCells<Dim>::write() {
  std::vector<Counts> first(static_cast<std::size_t>(block_count(std::ssize(lattice_.leaves), kLeavesPerBlock)));
  const auto for_block = [&](std::int64_t block, auto&& visit) {
    const std::int64_t end = std::min(std::ssize(lattice_.leaves), (block + 1) * kLeavesPerBlock);
    for (std::int64_t leaf = block * kLeavesPerBlock; leaf < end; ++leaf)
      for_new_cells(static_cast<LeafId>(leaf), visit);
  };
  parallel_for(execution_, std::ssize(first), 1, [&](std::int64_t block) {
    Counts count{};
    for_block(block, [&]<std::size_t N>(const std::array<VertexId, N>&, MaterialId) { ++count[kKind<N>]; });
    first[block] = count;
  });
  Counts total{};
  for (Counts& c : first)
    for (std::size_t k = 0; k < c.size(); ++k) total[k] += std::exchange(c[k], total[k]);
  std::array<CellBlock, 2> added;
  for (std::size_t k = 0; k < added.size(); ++k) {
    added[k].type = k == 0 ? CellType::pyramid : kBoxTypes[Dim];
    added[k].vertices.resize(static_cast<std::size_t>(total[k] * vertex_count(added[k].type)));
    added[k].materials.resize(static_cast<std::size_t>(total[k]));
  }
  parallel_for(execution_, std::ssize(first), 1, [&](std::int64_t block) {
    Counts next = first[block];
    for_block(block, [&]<std::size_t N>(const std::array<VertexId, N>& cell, MaterialId material) {
      const std::int64_t at = next[kKind<N>]++;
      std::ranges::copy(cell, added[kKind<N>].vertices.begin() + at * static_cast<std::int64_t>(N));
      added[kKind<N>].materials[at] = material;
    });
  });
  // The simplices that stay move to the front.
  CellBlock& simplices = mesh_.blocks[0];
  std::size_t kept = 0;
  for (std::size_t c = 0; c < gone_.size(); ++c) {
    if (gone_[c] != 0) continue;
    std::copy_n(simplices.vertices.begin() + c * (Dim + 1), Dim + 1, simplices.vertices.begin() + kept * (Dim + 1));
    simplices.materials[kept++] = simplices.materials[c];
  }
  simplices.vertices.resize(kept * (Dim + 1));
  simplices.materials.resize(kept);
  for (CellBlock& block : added) mesh_.blocks.push_back(std::move(block));
  std::erase_if(mesh_.blocks, [](const CellBlock& b) { return b.size() == 0; });
}

}  // namespace

template <int Dim>
void keep_whole(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, const WholeCellOptions& options,
                Execution& execution) {
  if (mesh.blocks.empty()) return;
  WholeCells<Dim>(mesh, lattice, options, execution).run();
}

template void keep_whole(Mesh<2>&, const SimplexLattice<2>&, const WholeCellOptions&, Execution&);
template void keep_whole(Mesh<3>&, const SimplexLattice<3>&, const WholeCellOptions&, Execution&);

}  // namespace treemarch
