#include "treemarch/march/paper_cells.h"

#include <algorithm>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {

namespace {

template <int Dim>
const CellBlock* simplices(const Mesh<Dim>& mesh) {
  const auto block = std::ranges::find(mesh.blocks, kSimplex<Dim>, &CellBlock::type);
  return block == mesh.blocks.end() ? nullptr : &*block;
}

}  // namespace

template <int Dim>
ActiveCells<Dim>::ActiveCells(const Mesh<Dim>& mesh) : head_(mesh.points.size(), kNone) {
  find_linked(mesh);
  const CellBlock* block = simplices(mesh);
  if (block == nullptr) return;
  for (std::int64_t i = 0; i < block->size(); ++i) {
    Cell cell;
    std::copy_n(block->cell(i), Dim + 1, cell.begin());
    if (std::ranges::any_of(cell, [&](VertexId v) { return linked(v); })) {
      push(cell, block->materials[static_cast<std::size_t>(i)], i);
    }
  }
}

template <int Dim>
void ActiveCells<Dim>::find_linked(const Mesh<Dim>& mesh) {
  std::vector<MaterialId> first(mesh.points.size(), kOutside);
  linked_.assign(mesh.points.size(), 0);
  for (const CellBlock& block : mesh.blocks) {
    const int corners = vertex_count(block.type);
    for (std::int64_t i = 0; i < block.size(); ++i) {
      const MaterialId material = block.materials[static_cast<std::size_t>(i)];
      for (int k = 0; k < corners; ++k) {
        const VertexId v = block.cell(i)[k];
        if (first[v] == kOutside) first[v] = material;
        linked_[v] |= static_cast<std::uint8_t>(first[v] != material);
      }
    }
  }
  for (const CellBlock& block : mesh.blocks) {
    if (block.type == kSimplex<Dim>) continue;
    if (std::ranges::any_of(block.vertices, [&](VertexId v) { return linked(v); })) {
      throw Error(ErrorKind::limits,
                  "march: a cell that is no simplex touches two materials; tessellate all cells at interfaces");
    }
  }
}

template <int Dim>
void ActiveCells<Dim>::push(const Cell& cell, MaterialId material, std::int64_t parent) {
  if (cells_.size() >= kNone / (Dim + 1)) {
    throw Error(ErrorKind::limits, "march: too many cells at interfaces; choose larger cells there");
  }
  cells_.push_back(cell);
  materials_.push_back(material);
  parents_.push_back(parent);
  next_.resize(cells_.size() * (Dim + 1), kNone);
  link(size() - 1);
}

template <int Dim>
void ActiveCells<Dim>::link(Index c) {
  for (int k = 0; k <= Dim; ++k) {
    const VertexId v = cells_[c][k];
    if (!linked(v)) continue;
    const std::uint32_t entry = c * (Dim + 1) + static_cast<std::uint32_t>(k);
    next_[entry] = head_[v];
    head_[v] = entry;
  }
}

template <int Dim>
void ActiveCells<Dim>::unlink(Index c) {
  for (int k = 0; k <= Dim; ++k) {
    const VertexId v = cells_[c][k];
    if (!linked(v)) continue;
    const std::uint32_t entry = c * (Dim + 1) + static_cast<std::uint32_t>(k);
    std::uint32_t* at = &head_[v];
    while (*at != entry) at = &next_[*at];
    *at = next_[entry];
  }
}

template <int Dim>
typename ActiveCells<Dim>::Index ActiveCells<Dim>::neighbour(Index c, int corner) const {
  const Cell& own = cells_[c];
  int pivot = 0;
  while (pivot == corner || !linked(own[pivot])) ++pivot;
  for (std::uint32_t e = head_[own[pivot]]; e != kNone; e = next_[e]) {
    const Index other = e / (Dim + 1);
    if (other == c) continue;
    int shared = 0;
    for (int k = 0; k <= Dim; ++k) shared += k != corner && std::ranges::count(cells_[other], own[k]) != 0;
    if (shared == Dim) return other;
  }
  return kNone;
}

template <int Dim>
void ActiveCells<Dim>::add_vertices(std::size_t count) {
  linked_.resize(linked_.size() + count, 1);
  head_.resize(head_.size() + count, kNone);
}

template <int Dim>
void ActiveCells<Dim>::replace(Index c, std::span<const Cell> pieces, std::span<const MaterialId> materials) {
  unlink(c);
  cells_[c] = pieces[0];
  materials_[c] = materials[0];
  link(c);
  for (std::size_t i = 1; i < pieces.size(); ++i) push(pieces[i], materials[i], parents_[c]);
}

template <int Dim>
void ActiveCells<Dim>::write_back(Mesh<Dim>& mesh) const {
  const auto found = std::ranges::find(mesh.blocks, kSimplex<Dim>, &CellBlock::type);
  if (found == mesh.blocks.end()) return;
  CellBlock& block = *found;
  // Where each cell of the old block starts in the new one.
  std::vector<std::int64_t> place(static_cast<std::size_t>(block.size()) + 1, 1);
  place.back() = 0;
  for (const std::int64_t parent : parents_) ++place[static_cast<std::size_t>(parent)];
  // Cells that are not here count once, those that are as often as they have pieces.
  std::vector<std::uint8_t> active(static_cast<std::size_t>(block.size()), 0);
  for (const std::int64_t parent : parents_) {
    if (!active[static_cast<std::size_t>(parent)]) --place[static_cast<std::size_t>(parent)];
    active[static_cast<std::size_t>(parent)] = 1;
  }
  const std::int64_t total = exclusive_scan(std::span(place));
  CellBlock out{block.type, RawVector<VertexId>(static_cast<std::size_t>(total) * (Dim + 1)),
                RawVector<MaterialId>(static_cast<std::size_t>(total))};
  const auto put = [&](std::int64_t parent, const VertexId* cell, MaterialId material) {
    const std::int64_t at = place[static_cast<std::size_t>(parent)]++;
    std::copy_n(cell, Dim + 1, out.vertices.begin() + at * (Dim + 1));
    out.materials[static_cast<std::size_t>(at)] = material;
  };
  for (std::int64_t i = 0; i < block.size(); ++i) {
    if (!active[static_cast<std::size_t>(i)]) put(i, block.cell(i), block.materials[static_cast<std::size_t>(i)]);
  }
  for (Index c = 0; c < size(); ++c) put(parents_[c], cells_[c].data(), materials_[c]);
  block = std::move(out);
}

template class ActiveCells<2>;
template class ActiveCells<3>;
template class ActiveCells<4>;

}  // namespace treemarch
