/// \file
/// Points where several labels weigh the same: interfaces, junction curves and junction points.
#pragma once

#include <span>

#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"

namespace treemarch {

/// The largest weight among `a` minus the largest among `b` at x.
template <int Dim>
float best_difference(const Field<Dim>& field, const Vec<Dim>& x, std::span<const MaterialId> a,
                      std::span<const MaterialId> b);

/// The label of the largest weight. Of several the voxel's own, then the one with the largest weight at its centre: not
/// the order of the labels, but in the very last tie. \pre !labels.empty()
template <int Dim>
MaterialId heaviest(const Field<Dim>& field, const Vec<Dim>& x, std::span<const MaterialId> labels);

/// Moves a point to where the weights of all `labels` are equal, by a few damped Gauss-Newton steps of at most half a
/// voxel. \param fixed_axes bit d is set where the point must not move along axis d. \param steps at most so many. \pre
/// 2 <= labels.size() <= 8
template <int Dim>
Vec<Dim> move_to_junction(const Field<Dim>& field, Vec<Dim> x, std::span<const MaterialId> labels, unsigned fixed_axes,
                          int steps = 3);

}  // namespace treemarch
