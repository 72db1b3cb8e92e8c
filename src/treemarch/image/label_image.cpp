#include "treemarch/image/label_image.h"

#include <algorithm>

#include "treemarch/image/label_encoder.h"

namespace treemarch {

MaterialId material_of(const std::vector<std::int32_t>& labels, std::int32_t label) {
  const auto at = std::ranges::find(labels, label);
  return at == labels.end() ? kOutside : static_cast<MaterialId>(at - labels.begin());
}

template <int Dim>
LabelImage<Dim> make_label_image(const Coord<Dim>& extent, const std::vector<std::int32_t>& values,
                                 const Frame<Dim>& frame) {
  const Execution serial(1);
  LabelEncoder encoder(std::ssize(values), serial);
  encoder.add(std::span<const std::int32_t>(values));
  EncodedLabels encoded = encoder.take();
  LabelImage<Dim> image;
  image.extent = extent;
  image.frame = frame;
  image.voxels = std::move(encoded.voxels);
  image.labels = std::move(encoded.labels);
  return image;
}

template LabelImage<1> make_label_image(const Coord<1>&, const std::vector<std::int32_t>&, const Frame<1>&);
template LabelImage<2> make_label_image(const Coord<2>&, const std::vector<std::int32_t>&, const Frame<2>&);
template LabelImage<3> make_label_image(const Coord<3>&, const std::vector<std::int32_t>&, const Frame<3>&);
template LabelImage<4> make_label_image(const Coord<4>&, const std::vector<std::int32_t>&, const Frame<4>&);

}  // namespace treemarch
