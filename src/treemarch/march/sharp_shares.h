/// \file
/// What space-time is separated by: the d-linear function, sharpened in space so that round things keep their volume.
#pragma once

#include "treemarch/image/label_image.h"
#include "treemarch/march/separate.h"

namespace treemarch {

/// L + 2 (L - S L), L the d-linear interpolation of the voxels' indicators between voxel centres, constant beyond the
/// outermost centres, S the means 1:2:1 of neighbouring voxels along each axis but the last one, time. Flat surfaces
/// stay where L has them. On curved ones L and the chords of the facets both take a volume off that goes with the
/// curvature, and 2 makes up for it: see docs/stages/space-time.md. Between moments the function is linear. Values
/// add up to 1; they may be a little below 0 or above 1.
/// \pre `image` outlives the result
template <int Dim>
MaterialField<Dim> sharp_shares(const LabelImage<Dim>& image);

}  // namespace treemarch
