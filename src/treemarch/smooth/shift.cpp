#include "treemarch/smooth/shift.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "treemarch/core/parallel.h"
#include "treemarch/field/junction.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/material_mark.h"

namespace treemarch {
namespace {

constexpr std::int64_t kGrain = 4096;
constexpr int kMostMaterials = 8;  // that a junction can have
constexpr int kSteps = 6;          // of the search for the interface
constexpr std::array<double, 8> kFactors{1, 0.85, 0.7, 0.55, 0.4, 0.25, 0.1, 0};
constexpr int kAdvances = 20;

struct CellRef {
  std::uint32_t cell;
  std::uint8_t block;
  bool operator<(const CellRef& other) const { return std::tie(cell, block) < std::tie(other.cell, other.block); }
};

template <int Dim>
class Shifter {
 public:
  Shifter(Mesh<Dim>& mesh, const Field<Dim>& field, const ShiftOptions& options, Execution& execution)
      : mesh_(mesh), field_(field), options_(options), execution_(execution) {}

  ShiftReport run() {
    find_interface();
    find_cells();
    move_all();
    retreat(std::vector<std::uint8_t>(vertex_.size(), kFactors.size() - 1));
    advance();
    ShiftReport report;
    report.vertices = static_cast<std::int64_t>(vertex_.size());
    for (std::size_t s = 0; s < vertex_.size(); ++s) {
      report.shifted += mesh_.points[vertex_[s]] != home_[s];
      report.held_back += level_[s] > 0;
    }
    return report;
  }

 private:
  void find_interface();
  void find_cells();
  void move_all();
  struct Around {
    std::array<MaterialId, kMostMaterials> materials;
    std::size_t count = 0;
    Vec<Dim> side;
  };
  bool look_around(std::size_t slot, Around& around) const;
  [[nodiscard]] Vec<Dim> target_of(std::size_t slot) const;
  void set_level(std::size_t slot, std::uint8_t level);
  void retreat(const std::vector<std::uint8_t>& last);
  void advance();
  [[nodiscard]] bool is_spoilt(const CellRef& ref, VertexId moved = 0, const Vec<Dim>* there = nullptr) const;
  [[nodiscard]] std::array<Vec<Dim>, 8> corners(const CellRef& ref, bool at_home) const;

  [[nodiscard]] std::span<const CellRef> cells_of(std::size_t slot) const {
    return std::span(cells_).subspan(first_[slot], first_[slot + 1] - first_[slot]);
  }
  template <class Use>
  void for_cells(Use&& use) const {  // of interface vertices: use(slot, cell)
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const CellBlock& block = mesh_.blocks[b];
      const int corners = vertex_count(block.type);
      parallel_for(execution_, block.size(), kGrain, [&](std::int64_t c) {
        for (int k = 0; k < corners; ++k)
          if (const std::uint32_t s = slot_[block.cell(c)[k]]; s != kNone)
            use(s, CellRef{static_cast<std::uint32_t>(c), static_cast<std::uint8_t>(b)});
      });
    }
  }

  static constexpr std::uint32_t kNone = 0xffffffffU;
  Mesh<Dim>& mesh_;
  const Field<Dim>& field_;
  const ShiftOptions& options_;
  Execution& execution_;
  Vec<Dim> low_{}, high_{};           // bounding box
  std::vector<std::uint32_t> slot_;   // of every vertex, kNone off the interfaces
  std::vector<VertexId> vertex_;      // of every slot
  std::vector<std::uint64_t> first_;  // cells around a slot, into cells_
  std::vector<CellRef> cells_;
  std::vector<Vec<Dim>> home_, whole_move_;
  std::vector<std::uint8_t> level_;  // into kFactors
};

/// Numbers the vertices that have cells of several materials.
template <int Dim>
void Shifter<Dim>::find_interface() {
  std::vector<MaterialId> around(mesh_.points.size(), kOutside);
  for (const CellBlock& block : mesh_.blocks) {
    const int corners = vertex_count(block.type);
    parallel_for(execution_, block.size(), kGrain, [&](std::int64_t c) {
      for (int k = 0; k < corners; ++k) note_material(around[block.cell(c)[k]], block.materials[c]);
    });
  }
  slot_.assign(mesh_.points.size(), kNone);
  low_ = high_ = mesh_.points[0];
  for (std::size_t v = 0; v < around.size(); ++v) {
    const Vec<Dim>& x = mesh_.points[v];
    for (int d = 0; d < Dim; ++d) low_[d] = std::min(low_[d], x[d]), high_[d] = std::max(high_[d], x[d]);
    if (around[v] != kSeveral) continue;
    slot_[v] = static_cast<std::uint32_t>(vertex_.size());
    vertex_.push_back(static_cast<VertexId>(v));
    home_.push_back(x);
  }
}

template <int Dim>
void Shifter<Dim>::find_cells() {
  first_.assign(vertex_.size() + 1, 0);
  for_cells(
      [&](std::uint32_t s, const CellRef&) { std::atomic_ref(first_[s]).fetch_add(1, std::memory_order_relaxed); });
  cells_.resize(exclusive_scan(std::span(first_)));
  std::vector<std::uint64_t> next = first_;
  for_cells([&](std::uint32_t s, const CellRef& ref) {
    cells_[std::atomic_ref(next[s]).fetch_add(1, std::memory_order_relaxed)] = ref;
  });
  parallel_for(execution_, static_cast<std::int64_t>(vertex_.size()), kGrain,
               [&](std::int64_t s) { std::sort(cells_.begin() + first_[s], cells_.begin() + first_[s + 1]); });
}

template <int Dim>
std::array<Vec<Dim>, 8> Shifter<Dim>::corners(const CellRef& ref, bool at_home) const {
  const CellBlock& block = mesh_.blocks[ref.block];
  std::array<Vec<Dim>, 8> p{};
  for (int k = 0; k < vertex_count(block.type); ++k) {
    const VertexId v = block.cell(ref.cell)[k];
    p[k] = at_home && slot_[v] != kNone ? home_[slot_[v]] : mesh_.points[v];
  }
  return p;
}

/// Materials, ascending, and smallest sides of the cells around a vertex. \return false if the materials are too many
template <int Dim>
bool Shifter<Dim>::look_around(std::size_t slot, Around& around) const {
  around.side.fill(std::numeric_limits<double>::infinity());
  for (const CellRef& ref : cells_of(slot)) {
    const CellBlock& block = mesh_.blocks[ref.block];
    const MaterialId m = block.materials[ref.cell];
    std::size_t at = 0;
    while (at < around.count && around.materials[at] < m) ++at;
    if (at == around.count || around.materials[at] != m) {
      if (around.count == around.materials.size()) return false;
      for (std::size_t k = around.count++; k > at; --k) around.materials[k] = around.materials[k - 1];
      around.materials[at] = m;
    }
    const auto p = corners(ref, true);
    for (int d = 0; d < Dim; ++d) {
      double low = p[0][d], high = p[0][d];
      for (int k = 1; k < vertex_count(block.type); ++k) low = std::min(low, p[k][d]), high = std::max(high, p[k][d]);
      around.side[d] = std::min(around.side[d], high - low);
    }
  }
  return true;
}

/// The nearest place where the materials around the vertex weigh the same, as far as the limits allow, which are along
/// each axis: where one is met, that axis is left alone from there on.
template <int Dim>
Vec<Dim> Shifter<Dim>::target_of(std::size_t slot) const {
  const Vec<Dim>& home = home_[slot];
  Around around;
  if (!look_around(slot, around)) return home;
  unsigned fixed = 0;
  for (int d = 0; d < Dim; ++d) fixed |= (home[d] == low_[d] || home[d] == high_[d] ? 1U : 0U) << d;
  Vec<Dim> at = home;
  while (fixed != (1U << Dim) - 1) {
    const Vec<Dim> wish = move_to_junction(field_, at, std::span(around.materials).first(around.count), fixed, kSteps);
    double part = 1;
    int axis = -1;
    for (int d = 0; d < Dim; ++d) {
      const double most = options_.most * around.side[d];
      if ((fixed >> d & 1) != 0 || std::abs(wish[d] - home[d]) <= most) continue;
      const double limit = home[d] + std::copysign(most, wish[d] - home[d]);
      if (const double p = (limit - at[d]) / (wish[d] - at[d]); axis < 0 || p < part) part = p, axis = d;
    }
    if (axis < 0) return wish;
    at = at + part * (wish - at);
    at[axis] = home[axis] + std::copysign(options_.most * around.side[axis], wish[axis] - home[axis]);
    fixed |= 1U << axis;
  }
  return at;
}

template <int Dim>
void Shifter<Dim>::move_all() {
  whole_move_.resize(vertex_.size());
  level_.assign(vertex_.size(), 0);
  parallel_for(execution_, static_cast<std::int64_t>(vertex_.size()), 256,
               [&](std::int64_t s) { whole_move_[s] = target_of(s) - home_[s]; });
  for (std::size_t s = 0; s < vertex_.size(); ++s) set_level(s, 0);
}

/// Whether a cell has lost too much of its shape, if one vertex of it were there.
template <int Dim>
bool Shifter<Dim>::is_spoilt(const CellRef& ref, VertexId moved, const Vec<Dim>* there) const {
  const CellBlock& block = mesh_.blocks[ref.block];
  auto p = corners(ref, false);
  if (there)
    for (int k = 0; k < vertex_count(block.type); ++k)
      if (block.cell(ref.cell)[k] == moved) p[k] = *there;
  const CornerJacobians now = corner_jacobians<Dim>(p, block.type),
                        before = corner_jacobians<Dim>(corners(ref, true), block.type);
  return !(now.min_scaled >= options_.keep * before.min_scaled && now.ratio() >= options_.keep_ratio * before.ratio());
}

template <int Dim>
void Shifter<Dim>::set_level(std::size_t slot, std::uint8_t level) {
  level_[slot] = level;
  mesh_.points[vertex_[slot]] = home_[slot] + kFactors[level] * whole_move_[slot];
}

/// Rounds on one state each: all vertices of spoilt cells go back one level, as far as `last` allows, until no cell is
/// spoilt. Levels only rise, so it ends. \pre at their last levels no cell is spoilt
template <int Dim>
void Shifter<Dim>::retreat(const std::vector<std::uint8_t>& last) {
  std::vector<std::uint32_t> active;
  for (std::size_t s = 0; s < last.size(); ++s)
    if (level_[s] < last[s]) active.push_back(static_cast<std::uint32_t>(s));
  while (!active.empty()) {
    std::vector<std::uint8_t> back(vertex_.size(), 0);
    parallel_for(execution_, std::ssize(active), 256, [&](std::int64_t i) {
      for (const CellRef& ref : cells_of(active[i]))
        if (is_spoilt(ref)) std::atomic_ref(back[active[i]]).store(1, std::memory_order_relaxed);
    });
    // A cell was looked at by all its vertices that may have moved: each of them knows.
    std::vector<std::uint32_t> moved;
    for (const std::uint32_t s : active) {
      if (!back[s] || level_[s] == last[s]) continue;
      set_level(s, level_[s] + 1);
      moved.push_back(s);
    }
    // What changed next to them is to be looked at again, from all vertices of those cells.
    std::vector<std::uint8_t> again(vertex_.size(), 0);
    for (const std::uint32_t s : moved)
      for (const CellRef& ref : cells_of(s)) {
        const CellBlock& block = mesh_.blocks[ref.block];
        for (int k = 0; k < vertex_count(block.type); ++k)
          if (const std::uint32_t t = slot_[block.cell(ref.cell)[k]]; t != kNone) again[t] = 1;
      }
    active.clear();
    for (std::size_t s = 0; s < again.size(); ++s)
      if (again[s] && level_[s] < last[s]) active.push_back(static_cast<std::uint32_t>(s));
  }
}

/// All vertices of a spoilt cell went back, most of them without need: each that can go a level on while its
/// neighbours stay does so; where several together spoil a cell they go back.
template <int Dim>
void Shifter<Dim>::advance() {
  for (int round = 0; round < kAdvances; ++round) {
    const std::vector<std::uint8_t> before = level_;
    std::vector<std::uint8_t> can(vertex_.size(), 0);
    parallel_for(execution_, std::ssize(vertex_), 256, [&](std::int64_t s) {
      if (level_[s] == 0) return;
      const Vec<Dim> there = home_[s] + kFactors[level_[s] - 1] * whole_move_[s];
      can[s] =
          std::ranges::none_of(cells_of(s), [&](const CellRef& ref) { return is_spoilt(ref, vertex_[s], &there); });
    });
    for (std::size_t s = 0; s < can.size(); ++s)
      if (can[s] != 0) set_level(s, level_[s] - 1);
    retreat(before);
    if (level_ == before) return;
  }
}

}  // namespace

template <int Dim>
ShiftReport shift_vertices(Mesh<Dim>& mesh, const Field<Dim>& field, const ShiftOptions& options,
                           Execution& execution) {
  const Execution::Stage stage(execution, "shift");
  if (mesh.points.empty() || options.most <= 0) return {};
  return Shifter<Dim>(mesh, field, options, execution).run();
}

template ShiftReport shift_vertices(Mesh<2>&, const Field<2>&, const ShiftOptions&, Execution&);
template ShiftReport shift_vertices(Mesh<3>&, const Field<3>&, const ShiftOptions&, Execution&);

}  // namespace treemarch
