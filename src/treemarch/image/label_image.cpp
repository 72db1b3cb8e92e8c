#include "treemarch/image/label_image.h"

#include <algorithm>

namespace treemarch {

template <int Dim>
LabelImage<Dim> make_label_image(const Coord<Dim>& extent, const std::vector<std::int32_t>& values,
                                 const Frame<Dim>& frame) {
  LabelImage<Dim> image;
  image.extent = extent;
  image.frame = frame;

  std::vector<std::int32_t> sorted;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (i == 0 || values[i] != values[i - 1]) sorted.push_back(values[i]);
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());

  constexpr MaterialId kNone = kOutside;
  std::vector<MaterialId> material(sorted.size(), kNone);
  image.voxels = CompactArray(static_cast<std::int64_t>(values.size()), sorted.size());
  std::size_t rank = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i == 0 || values[i] != values[i - 1])
      rank = static_cast<std::size_t>(std::lower_bound(sorted.begin(), sorted.end(), values[i]) - sorted.begin());
    if (material[rank] == kNone) {
      material[rank] = static_cast<MaterialId>(image.labels.size());
      image.labels.push_back(values[i]);
    }
    image.voxels.set(static_cast<std::int64_t>(i), material[rank]);
  }
  return image;
}

template LabelImage<1> make_label_image(const Coord<1>&, const std::vector<std::int32_t>&, const Frame<1>&);
template LabelImage<2> make_label_image(const Coord<2>&, const std::vector<std::int32_t>&, const Frame<2>&);
template LabelImage<3> make_label_image(const Coord<3>&, const std::vector<std::int32_t>&, const Frame<3>&);
template LabelImage<4> make_label_image(const Coord<4>&, const std::vector<std::int32_t>&, const Frame<4>&);

}  // namespace treemarch
