/// \file
/// Cells of space-time that reach from one moment of an image to the next. See docs/stages/space-time.md.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

/// An image with a voxel for every two moments that follow each other, of the labels at the later one, and one before
/// the first and after the last moment: so that faces between its voxels are at the moments themselves. Its frame and
/// its inner frame mean nothing; see move_to_moments().
template <int Dim>
LabelImage<Dim> between_moments(const LabelImage<Dim>& image, const Execution& execution);

/// The sizes for that image: as asked for at either moment, and at a voxel those of the interfaces that it touches at
/// the earlier one.
template <int Dim>
SizingRule sizes_between_moments(const LabelImage<Dim>& image, const SizingRule& rule, const Execution& execution);

/// Moves the points of a mesh of between_moments() to where they are in the inner frame of the image itself. The first
/// and the last half step are as long there as a whole one here, so that the mesh ends where the image does.
/// \pre cells have not been cut: boxes remain boxes
template <int Dim>
void move_to_moments(Mesh<Dim>& mesh, const LabelImage<Dim>& image, const Execution& execution);

}  // namespace treemarch
