/// \file
/// Separating functions of one material that are given by position.
#pragma once

#include <functional>
#include <span>

#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"

namespace treemarch {

/// The share f_m in [0, 1] of one material at points of the inner frame; the surface around the material is f_m = 1/2.
/// Writes one value a point. Called from several threads at once; the value may depend on nothing but the arguments.
template <int Dim>
using MaterialField =
    std::function<void(MaterialId material, std::span<const Vec<Dim>> points, std::span<double> values)>;

/// A material against the best of the rest: 1/2 + (w_m - largest other weight) / 2, within [0, 1]. With two materials
/// whose weights add up to 1 that is w_m; where three meet, the surfaces of all three meet in one curve.
/// \pre `field` outlives the result
template <int Dim>
MaterialField<Dim> against_the_rest(const Field<Dim>& field);

}  // namespace treemarch
