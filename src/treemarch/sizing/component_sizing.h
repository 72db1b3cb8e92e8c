/// \file
/// Sizes that keep small components: islands, grains and wires that larger cells would lose.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/sizing/sizing_rule.h"

namespace treemarch {

struct ComponentSizing {
  std::int64_t min_component = 8;  ///< voxels; smaller ones count only as the largest of their label
  MaterialId left_out = kOutside;  ///< a material whose components do not matter
  double floor = 0;                ///< size that cells at interfaces have anyway, > 0
  double least = 0;                ///< no size below this is asked for, > 0
};

/// Asks for sizes in the voxels of the components (joined over faces) that cells of `floor` are too large for: those
/// whose volume is less than that of a cube of a cell's side, or whose thickness, twice their volume over their area,
/// is less than a third of it as that of a cube is. Sizes are halves of the floor, components come by their first
/// voxels.
template <int Dim>
std::vector<SizingRule::Voxel> component_sizes(const LabelImage<Dim>& image, const ComponentSizing& sizing,
                                               const Execution& execution);

}  // namespace treemarch
