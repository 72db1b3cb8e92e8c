/// \file
/// The separating function that the options of mesh_image() name.
#pragma once

#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/image/label_image.h"
#include "treemarch/pipeline/mesh_image.h"

namespace treemarch {

/// The kind of field: what the options say; else grey where there is a grey image; else `usual`.
template <int Dim>
FieldKind field_kind(const MeshOptions& options, const GreyInput<Dim>* grey, FieldKind usual);

/// The field of that kind, its weights multiplied as in FieldOptions::scale. \throw Error(usage) if the kind is grey
/// and there is no grey image; Error(input) if the extents differ.
template <int Dim>
Field<Dim> make_field(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, FieldKind kind,
                      const MeshOptions& options, Execution& execution, std::vector<float> scale = {});

}  // namespace treemarch
