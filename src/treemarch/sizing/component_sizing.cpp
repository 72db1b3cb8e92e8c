#include "treemarch/sizing/component_sizing.h"

#include <array>
#include <cmath>

#include "treemarch/topology/image_components.h"

namespace treemarch {
namespace {

/// Gathers the voxels of components, one after the other.
template <int Dim>
class Flood {
 public:
  explicit Flood(const LabelImage<Dim>& image) : image_(image), seen_(static_cast<std::size_t>(image.voxels.size())) {
    std::int64_t n = 1;
    for (int d = 0; d < Dim; n *= image.extent[d++]) {
      stride_[d] = n;
      face_[d] = image.voxel_volume() / image.frame.spacing[d];
    }
  }

  /// The voxels of the component of one of them, until the next call; and the area of its faces to other materials.
  const std::vector<std::int64_t>& gather(std::int64_t first) {
    voxels_.assign(1, first);
    seen_[static_cast<std::size_t>(first)] = 1;
    area_ = 0;
    for (std::size_t next = 0; next < voxels_.size(); ++next) {
      const std::int64_t v = voxels_[next];
      const Coord<Dim> c = coord_of(v, image_.extent);
      for (int d = 0; d < Dim; ++d) {
        if (c[d] > 0) look(v, v - stride_[d], d);
        if (c[d] + 1 < image_.extent[d]) look(v, v + stride_[d], d);
      }
    }
    return voxels_;
  }
  [[nodiscard]] double area() const { return area_; }

 private:
  void look(std::int64_t from, std::int64_t to, int axis) {
    if (image_.voxels[to] != image_.voxels[from])
      area_ += face_[axis];
    else if (auto& seen = seen_[static_cast<std::size_t>(to)]; seen == 0)
      seen = 1, voxels_.push_back(to);
  }

  const LabelImage<Dim>& image_;
  std::vector<std::uint8_t> seen_;
  std::array<std::int64_t, Dim> stride_{};
  std::array<double, Dim> face_{};  // area of a face across each axis
  std::vector<std::int64_t> voxels_;
  double area_ = 0;
};

}  // namespace

template <int Dim>
std::vector<SizingRule::Voxel> component_sizes(const LabelImage<Dim>& image, const ComponentSizing& sizing,
                                               const Execution& execution) {
  // Longer wires and wider sheets than this many cells have not so many voxels that their label's share would be
  // unknown to sizes by material.
  constexpr double kMostCells = 64;
  const double voxel = image.voxel_volume();
  const double most_voxels = kMostCells * std::pow(sizing.floor, Dim) / voxel;
  const std::vector<ImageComponent> components = image_components(image, execution);
  const std::vector<std::int64_t> largest = largest_components(components, image.labels.size());
  std::vector<const ImageComponent*> small;
  for (const ImageComponent& c : components) {
    const std::int64_t most = components[static_cast<std::size_t>(largest[c.material])].voxels;
    if (c.material != sizing.left_out && (c.voxels >= sizing.min_component || c.voxels == most) &&
        static_cast<double>(c.voxels) <= most_voxels)
      small.push_back(&c);
  }
  std::vector<SizingRule::Voxel> sizes;
  if (small.empty()) return sizes;
  Flood<Dim> flood(image);
  for (const ImageComponent* c : small) {
    const std::vector<std::int64_t>& voxels = flood.gather(c->first_voxel);
    if (flood.area() == 0) continue;  // it fills the image
    const double volume = static_cast<double>(c->voxels) * voxel;
    const double wanted = std::min(std::pow(volume, 1.0 / Dim), Dim * 2 * volume / flood.area());
    double size = sizing.floor;
    while (size > wanted * kSizeTolerance && size / 2 * kSizeTolerance >= sizing.least) size /= 2;
    if (size == sizing.floor) continue;
    for (const std::int64_t v : voxels) sizes.push_back({v, static_cast<float>(size)});
  }
  return sizes;
}

template std::vector<SizingRule::Voxel> component_sizes(const LabelImage<2>&, const ComponentSizing&, const Execution&);
template std::vector<SizingRule::Voxel> component_sizes(const LabelImage<3>&, const ComponentSizing&, const Execution&);

}  // namespace treemarch
