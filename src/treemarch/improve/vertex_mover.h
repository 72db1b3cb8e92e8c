/// \file
/// Moves one vertex to where the worst element around it is better.
#pragma once

#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/patch.h"
#include "treemarch/improve/stratum.h"

namespace treemarch {

struct MoveLimits {
  double displacement = 0;  ///< from where the vertex was at first
  double slack = 0;         ///< how far a vertex may get off its interface (one that is further off may stay so)
  double goal = 20;         ///< degrees; a vertex whose cells reach it is left alone
  /// Of the shortest edge at the vertex: displacement that is allowed as well, within a material and along interfaces.
  double inner_reach = 0, reach = 0;
};

/// Finds a place for v with a better worst element around it: the mean of its neighbours, then steps up the steepest
/// direction that all the worst elements share (the point of smallest norm in the hull of their gradients). Along its
/// stratum, or freely within limits.slack of it if `loose`. Materials with no surface to follow (four or more, or where
/// the field does not tell) move within the slack of `start`.
/// \param start where the vertex was at first.
/// \return whether there is one, in `x`. Reads the positions of v and its neighbours only. \pre patch.has_star(v)
template <int Dim>
bool find_better_place(const Patch<Dim>& patch, VertexId v, const Field<Dim>& field, const Vec<Dim>& box,
                       const MoveLimits& limits, bool loose, const Vec<Dim>& start, Vec<Dim>& x);

/// Finds a place for v nearer to its stratum: all the way, or a half or a quarter of it, as far as every cell around v
/// reaches limits.goal. Places within limits.slack are left alone.
/// \return whether there is one, in `x`. \pre patch.has_star(v)
template <int Dim>
bool find_nearer_place(const Patch<Dim>& patch, VertexId v, const Field<Dim>& field, const Vec<Dim>& box,
                       const MoveLimits& limits, const Vec<Dim>& start, Vec<Dim>& x);

/// Smallest quality of the cells around v, in degrees; -1 if one is inverted.
template <int Dim>
double star_quality(const Patch<Dim>& patch, VertexId v);

}  // namespace treemarch
