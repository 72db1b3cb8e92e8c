#include "treemarch/pipeline/make_field.h"

#include <utility>

#include "treemarch/core/error.h"

namespace treemarch {

template <int Dim>
FieldKind field_kind(const MeshOptions& options, const GreyInput<Dim>* grey, FieldKind usual) {
  return options.field.value_or(grey ? FieldKind::grey : usual);
}

template <int Dim>
Field<Dim> make_field(const LabelImage<Dim>& image, const GreyInput<Dim>* grey, FieldKind kind,
                      const MeshOptions& options, Execution& execution, std::vector<float> scale) {
  FieldOptions how;
  how.kind = kind;
  how.sigma = options.sigma;
  how.background = options.background;
  how.scale = std::move(scale);
  if (kind != FieldKind::grey) return build_field(image, how, execution);
  if (!grey) throw Error(ErrorKind::usage, "--field: grey needs a grey image; give --grey and --threshold");
  return build_grey_field(image, grey->image, grey->threshold, how, execution);
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                             \
  template FieldKind field_kind(const MeshOptions&, const GreyInput<DIM>*, FieldKind);                         \
  template Field<DIM> make_field(const LabelImage<DIM>&, const GreyInput<DIM>*, FieldKind, const MeshOptions&, \
                                 Execution&, std::vector<float>);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch
