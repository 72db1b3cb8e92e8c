/// \file
/// What to do about a bad cell when moving its vertices is not enough.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/improve.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/vertex_mover.h"

namespace treemarch {

/// Tries operations on bad cells one after the other, worst first: serial, as few cells need it.
template <int Dim>
class Remesher {
 public:
  /// \param start first position of every chosen vertex of the patch, in their order.
  Remesher(Patch<Dim>& patch, std::vector<Vec<Dim>> start, const Field<Dim>& field, const Vec<Dim>& box,
           const MoveLimits& limits, ImproveReport& report)
      : patch_(patch), start_(std::move(start)), field_(field), box_(box), limits_(limits), report_(report) {}

  /// Cells of the patch below `target`, worst first.
  [[nodiscard]] std::vector<CellId> bad_cells(double target) const;
  /// One pass over them. Stops early once stop() is true.
  /// \return how many of them were improved.
  std::int64_t pass(double target, const std::function<bool()>& stop);
  /// First positions, with those of vertices that were added.
  [[nodiscard]] const std::vector<Vec<Dim>>& start() const { return start_; }

 private:
  [[nodiscard]] double quality_of_cell(CellId c) const { return quality(patch_.angles(patch_.cell(c))); }
  bool improve_cell(CellId c);
  bool move(VertexId v, bool loose, double goal);
  bool move_corners(CellId c, bool loose);
  bool flip(CellId c);
  bool collapse(CellId c);
  bool make_room(CellId c);
  bool split(CellId c);
  void split_edge(VertexId a, VertexId b);
  template <class Change>
  bool attempt(CellId c, Change&& change);

  void touch(VertexId v);
  [[nodiscard]] bool worth_trying(CellId c) const;

  Patch<Dim>& patch_;
  std::vector<Vec<Dim>> start_;
  const Field<Dim>& field_;
  Vec<Dim> box_;
  MoveLimits limits_;
  ImproveReport& report_;
  int pass_ = 0;
  std::vector<int> touched_;  // of every chosen vertex: the last pass that changed its star
};

}  // namespace treemarch
