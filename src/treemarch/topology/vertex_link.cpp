#include "treemarch/topology/vertex_link.h"

#include <algorithm>

namespace treemarch {
namespace {

std::size_t scatter(std::uint64_t key) { return static_cast<std::size_t>((key * 0x9e3779b97f4a7c15U) >> 40U); }

}  // namespace

template <int Dim>
void VertexLink<Dim>::clear() {
  for (const std::uint32_t slot : used_) slots_[slot] = {};
  used_.clear();
  facets_.clear();
}

template <int Dim>
void VertexLink<Dim>::grow() {
  std::vector<Slot> old(2 * slots_.size());
  old.swap(slots_);
  std::vector<std::uint32_t> filled;
  filled.swap(used_);
  const std::size_t mask = slots_.size() - 1;
  for (const std::uint32_t from : filled) {
    std::size_t i = scatter(old[from].key) & mask;
    while (slots_[i].key != kEmpty) i = (i + 1) & mask;
    slots_[i] = old[from];
    used_.push_back(static_cast<std::uint32_t>(i));
  }
}

template <int Dim>
void VertexLink<Dim>::add_side(std::uint64_t key, MaterialId material) {
  const std::size_t mask = slots_.size() - 1;
  for (std::size_t i = scatter(key) & mask;; i = (i + 1) & mask) {
    Slot& slot = slots_[i];
    if (slot.key == key) {
      slot.second = material;
      return;
    }
    if (slot.key != kEmpty) continue;
    slot = {key, material, kOutside};
    used_.push_back(static_cast<std::uint32_t>(i));
    if (2 * used_.size() > slots_.size()) grow();
    return;
  }
}

template <int Dim>
void VertexLink<Dim>::add(CellType type, const VertexId* cell, VertexId vertex, MaterialId material) {
  const auto side = [&](VertexId a, VertexId b) { add_side(name_of(a, b), material); };
  if constexpr (Dim == 3) {
    if (type == CellType::tetrahedron) {
      std::array<VertexId, 3> other{};
      int n = 0;
      for (int k = 0; k < 4; ++k)
        if (cell[k] != vertex) other[static_cast<std::size_t>(n++)] = cell[k];
      side(other[0], other[1]);
      side(other[0], other[2]);
      side(other[1], other[2]);
      return;
    }
  }
  const CellTopology& shape = topology(type);
  for (int f = 0; f < shape.facet_count; ++f)
    for_each_corner(shape.facets[f], cell, [&](VertexId v, VertexId next, VertexId previous) {
      if (v == vertex) side(next, previous);
    });
}

template <int Dim>
int VertexLink<Dim>::excess_of(MaterialId material) {
  if constexpr (Dim == 2) {  // an arc has two ends
    const auto ends =
        std::ranges::count_if(border_, [&](const Slot& b) { return b.first == material || b.second == material; });
    return static_cast<int>(ends) / 2 - 1;
  }
  rim_.clear();
  parent_.clear();
  degree_.clear();
  const auto place = [&](VertexId v) {
    const auto at = static_cast<std::size_t>(std::ranges::find(rim_, v) - rim_.begin());
    if (at == rim_.size()) {
      rim_.push_back(v);
      parent_.push_back(static_cast<std::uint32_t>(at));
      degree_.push_back(0);
    }
    ++degree_[at];
    return static_cast<std::uint32_t>(at);
  };
  const auto root = [&](std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  };
  for (const Slot& b : border_) {
    if (b.first != material && b.second != material) continue;
    const std::uint32_t u = root(place(static_cast<VertexId>(b.key >> 32U)));
    const std::uint32_t v = root(place(static_cast<VertexId>(b.key)));
    parent_[std::max(u, v)] = std::min(u, v);
  }
  int curves = 0, crossings = 0;
  for (std::uint32_t i = 0; i < parent_.size(); ++i) {
    curves += parent_[i] == i;
    crossings += static_cast<int>(degree_[i]) / 2 - 1;
  }
  return curves - 1 + crossings;
}

/// Whether the border lies between two materials, or one and the outside, and is one simple closed curve, which most
/// are: found by walking along.
template <int Dim>
bool VertexLink<Dim>::is_simple() const {
  if constexpr (Dim == 2) return false;
  const Slot& first = border_[0];
  for (const Slot& b : border_)
    if ((b.first != first.first || b.second != first.second) && (b.first != first.second || b.second != first.first))
      return false;
  std::size_t at = 0;
  auto end = static_cast<VertexId>(first.key);
  for (std::size_t steps = 1;; ++steps) {
    std::size_t next = at;
    int meeting = 0;
    for (std::size_t i = 0; i < border_.size(); ++i) {
      const std::uint64_t key = border_[i].key;
      if (static_cast<VertexId>(key) != end && static_cast<VertexId>(key >> 32U) != end) continue;
      ++meeting;
      if (i != at) next = i;
    }
    if (meeting != 2) return false;
    if (next == 0) return steps == border_.size();
    at = next;
    const std::uint64_t key = border_[at].key;
    end = static_cast<VertexId>(key) == end ? static_cast<VertexId>(key >> 32U) : static_cast<VertexId>(key);
  }
}

template <int Dim>
const std::vector<typename VertexLink<Dim>::Excess>& VertexLink<Dim>::excess() {
  border_ = facets_;
  materials_.clear();
  excess_.clear();
  const auto note = [&](MaterialId m) {
    if (m != kOutside && std::ranges::find(materials_, m) == materials_.end()) materials_.push_back(m);
  };
  for (const std::uint32_t at : used_) {
    const Slot& slot = slots_[at];
    if (slot.first != slot.second) border_.push_back(slot);
  }
  if (!border_.empty() && is_simple()) return excess_;
  for (const Slot& b : border_) {
    note(b.first);
    note(b.second);
  }
  std::ranges::sort(materials_);
  const bool two = materials_.size() == 2 && std::ranges::none_of(border_, [](const Slot& b) {
                     return b.first == kOutside || b.second == kOutside;
                   });
  int sheets = 0;
  for (std::size_t i = 0; i < materials_.size(); ++i) {
    if (i == 0 || !two) sheets = excess_of(materials_[i]);  // two materials share their whole border
    if (sheets != 0) excess_.push_back({materials_[i], sheets});
  }
  return excess_;
}

template class VertexLink<2>;
template class VertexLink<3>;

}  // namespace treemarch
