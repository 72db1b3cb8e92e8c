/// \file
/// Separating functions that are given by position (design section 6).
#pragma once

#include <functional>
#include <span>

#include "treemarch/core/vec.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

/// The share f_m in [0, 1] of one material at points of the inner frame; the surface around the material is f_m = 1/2.
/// Writes one value a point. Called from several threads at once; the value may depend on nothing but the arguments.
template <int Dim>
using MaterialField =
    std::function<void(MaterialId material, std::span<const Vec<Dim>> points, std::span<double> values)>;

/// d-linear interpolation of the voxels' indicators between voxel centres, constant beyond the outermost centres.
/// \pre `image` outlives the result
template <int Dim>
MaterialField<Dim> linear_field(const LabelImage<Dim>& image);

}  // namespace treemarch
