#include "treemarch/march/whole_cells.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/core/ranked_bits.h"
#include "treemarch/march/band.h"

namespace treemarch {
namespace {

constexpr MaterialId kSeveral = kOutside - 1;
constexpr CellType kBoxTypes[] = {CellType::line, CellType::line, CellType::quad, CellType::hexahedron};

template <int Dim>
class WholeCells {
 public:
  using Simplex = std::array<VertexId, Dim + 1>;
  using Pyramid = std::array<VertexId, 5>;

  WholeCells(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, std::span<const std::int64_t> first_far,
             Execution& execution)
      : mesh_(mesh),
        lattice_(lattice),
        first_far_(first_far),
        execution_(execution),
        faces_(lattice.leaves.size(), 0),
        opened_(static_cast<std::int64_t>(lattice.vertices.size())) {}

  std::int64_t run() {
    find_materials();
    const auto blocks = static_cast<std::int64_t>(first_far_.size()) - 1;
    parallel_for(execution_, blocks, 1, [&](std::int64_t block) { find_whole_faces(block); });
    first_.resize(blocks);
    parallel_for(execution_, blocks, 1, [&](std::int64_t block) {
      Counts count{};
      for_cells(block, [&]<std::size_t N>(const std::array<VertexId, N>&, MaterialId) { ++count[kind<N>]; });
      first_[block] = count;
    });
    Counts total{};
    for (Counts& c : first_)
      for (std::size_t k = 0; k < c.size(); ++k) total[k] += std::exchange(c[k], total[k]);
    write(total);
    return total[0];
  }

 private:
  using Counts = std::array<std::int64_t, 3>;  // simplices, pyramids, boxes
  template <std::size_t N>
  static constexpr std::size_t kind = N == Dim + 1 ? 0
                                      : N == 5     ? 1
                                                   : 2;

  /// Calls visit(leaf, star, face, simplices, cells): those of one face after the other, and the cell of the mesh that
  /// each of them is, or -1 where it was cut. Far cells follow the order of the lattice's simplices.
  template <class Visit>
  void for_faces(std::int64_t block, Visit&& visit) const {
    std::array<Simplex, LeafStar<Dim>::kMostSimplices> listed;
    std::array<std::int64_t, LeafStar<Dim>::kMostSimplices> cells;
    std::int64_t next = first_far_[block];
    const std::int64_t end = first_far_[block + 1];
    const auto leaves = static_cast<std::int64_t>(lattice_.leaves.size());
    for (std::int64_t leaf = block * kLeavesPerBlock; leaf < std::min(leaves, (block + 1) * kLeavesPerBlock); ++leaf) {
      const LeafStar<Dim> star = lattice_.star(static_cast<LeafId>(leaf));
      for (int face = 0; face < LeafStar<Dim>::kFaces; ++face) {
        const int count = star.simplices(face, listed);
        for (int i = 0; i < count; ++i) {
          const bool far = next < end && std::equal(listed[i].begin(), listed[i].end(), mesh_.blocks[0].cell(next));
          cells[i] = far ? next++ : -1;
        }
        visit(static_cast<LeafId>(leaf), star, face, std::span(std::as_const(listed)).first(count),
              std::span(std::as_const(cells)).first(count));
      }
    }
  }

  void find_materials();
  void find_whole_faces(std::int64_t block);
  [[nodiscard]] bool is_whole(std::span<const Simplex> simplices, std::span<const std::int64_t> cells) const;
  [[nodiscard]] bool on_hull(const LeafStar<Dim>& star, int face) const {
    const std::int32_t at = lattice_.vertices[star.across[face]][face / 2];
    return at == 0 || at == lattice_.extent[face / 2];
  }
  template <class Visit>
  void for_cells(std::int64_t block, Visit&& visit) const;
  template <class Visit>
  void for_pyramids(const LeafStar<Dim>& star, int face, Visit&& visit) const;
  void write(const Counts& total);

  Mesh<Dim>& mesh_;
  const SimplexLattice<Dim>& lattice_;
  std::span<const std::int64_t> first_far_;
  Execution& execution_;
  std::vector<std::uint8_t> faces_;  // of each leaf: a bit for each face that it makes and that stays whole
  std::vector<MaterialId> around_;   // of the cells around each vertex, kSeveral if there are several
  RankedBits opened_;                // centres of leaves that are no boxes
  std::vector<Counts> first_;        // per block
};

template <int Dim>
void WholeCells<Dim>::find_materials() {
  around_.assign(mesh_.points.size(), kOutside);
  const CellBlock& cells = mesh_.blocks[0];
  parallel_for(execution_, cells.size(), kLeavesPerBlock, [&](std::int64_t c) {
    for (int k = 0; k <= Dim; ++k) {
      const std::atomic_ref<MaterialId> at(around_[cells.cell(c)[k]]);
      const MaterialId m = cells.materials[c];
      MaterialId seen = at.load(std::memory_order_relaxed);
      while (seen != m && seen != kSeveral &&
             !at.compare_exchange_weak(seen, seen == kOutside ? m : kSeveral, std::memory_order_relaxed)) {
      }
    }
  });
}

/// Whether the simplices of a face are all there, and none of their vertices is on an interface.
template <int Dim>
bool WholeCells<Dim>::is_whole(std::span<const Simplex> simplices, std::span<const std::int64_t> cells) const {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i] < 0) return false;
    for (const VertexId v : simplices[i])
      if (around_[v] != mesh_.blocks[0].materials[cells[0]]) return false;
  }
  return true;
}

template <int Dim>
void WholeCells<Dim>::find_whole_faces(std::int64_t block) {
  for_faces(block, [&](LeafId leaf, const LeafStar<Dim>& star, int face, std::span<const Simplex> simplices,
                       std::span<const std::int64_t> cells) {
    if (cells.empty()) return;
    const bool whole = !star.is_halved(face) && is_whole(simplices, cells);
    if (whole)
      faces_[leaf] |= static_cast<std::uint8_t>(1U << face);
    else
      opened_.insert(star.centre);
    // A larger leaf has smaller ones beside it.
    if constexpr (Dim == 3)
      if ((!whole || (star.split >> face & 1) != 0) && !on_hull(star, face)) opened_.insert(star.across[face]);
  });
}

template <int Dim>
template <class Visit>
void WholeCells<Dim>::for_pyramids(const LeafStar<Dim>& star, int face, Visit&& visit) const {
  const auto rim = star.rim(face);
  const auto pyramid = [&](VertexId apex, bool above) {
    visit(above ? Pyramid{rim[0], rim[1], rim[2], rim[3], apex} : Pyramid{rim[0], rim[3], rim[2], rim[1], apex});
  };
  const bool up = face % 2 != 0;
  if (opened_.contains(star.centre)) pyramid(star.centre, !up);
  if (!on_hull(star, face) && opened_.contains(star.across[face])) pyramid(star.across[face], up);
}

/// Calls visit(cell, material) for the simplices that stay and the cells that take the places of the others.
template <int Dim>
template <class Visit>
void WholeCells<Dim>::for_cells(std::int64_t block, Visit&& visit) const {
  for_faces(block, [&](LeafId leaf, const LeafStar<Dim>& star, int face, std::span<const Simplex> simplices,
                       std::span<const std::int64_t> cells) {
    const bool box = !opened_.contains(star.centre);
    if (face == 0 && box) visit(star.box(), around_[star.centre]);
    if (Dim == 2 ? box : (faces_[leaf] >> face & 1) != 0) {
      if constexpr (Dim == 3)
        for_pyramids(star, face, [&](const Pyramid& p) { visit(p, mesh_.blocks[0].materials[cells[0]]); });
      return;
    }
    for (std::size_t i = 0; i < simplices.size(); ++i)
      if (cells[i] >= 0) visit(simplices[i], mesh_.blocks[0].materials[cells[i]]);
  });
}

template <int Dim>
void WholeCells<Dim>::write(const Counts& total) {
  const CellBlock& old = mesh_.blocks[0];
  const std::int64_t far = first_far_.back(), rest = old.size() - far;
  std::array<CellBlock, 3> out;
  constexpr std::array<CellType, 3> kTypes{kSimplex<Dim>, CellType::pyramid, kBoxTypes[Dim]};
  for (std::size_t k = 0; k < out.size(); ++k) {
    const std::int64_t count = total[k] + (k == 0 ? rest : 0);
    out[k].type = kTypes[k];
    out[k].vertices.resize(count * vertex_count(kTypes[k]));
    out[k].materials.resize(count);
  }
  parallel_for(execution_, static_cast<std::int64_t>(first_.size()), 1, [&](std::int64_t block) {
    Counts next = first_[block];
    for_cells(block, [&]<std::size_t N>(const std::array<VertexId, N>& cell, MaterialId material) {
      const std::int64_t at = next[kind<N>]++;
      std::copy(cell.begin(), cell.end(), out[kind<N>].vertices.begin() + at * static_cast<std::int64_t>(N));
      out[kind<N>].materials[at] = material;
    });
  });
  std::copy(old.vertices.begin() + far * (Dim + 1), old.vertices.end(), out[0].vertices.begin() + total[0] * (Dim + 1));
  std::copy(old.materials.begin() + far, old.materials.end(), out[0].materials.begin() + total[0]);
  mesh_.blocks.clear();
  for (CellBlock& b : out)
    if (b.size() > 0) mesh_.blocks.push_back(std::move(b));
}

}  // namespace

template <int Dim>
std::int64_t keep_whole(Mesh<Dim>& mesh, const SimplexLattice<Dim>& lattice, std::span<const std::int64_t> first_far,
                        Execution& execution) {
  return WholeCells<Dim>(mesh, lattice, first_far, execution).run();
}

template std::int64_t keep_whole(Mesh<2>&, const SimplexLattice<2>&, std::span<const std::int64_t>, Execution&);
template std::int64_t keep_whole(Mesh<3>&, const SimplexLattice<3>&, std::span<const std::int64_t>, Execution&);

}  // namespace treemarch
