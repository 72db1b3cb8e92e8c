/// \file
/// A segmented image: one material a voxel.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "treemarch/core/vec.h"
#include "treemarch/image/frame.h"

namespace treemarch {

/// Dense index of a label: materials are numbered by their first appearance in scan order (first axis fastest), so that
/// permuting the label values of an image changes no result but the values.
using MaterialId = std::uint32_t;
/// The explicit label of what lies beyond the image.
inline constexpr MaterialId kOutside = 0xffffffffU;

/// An array of small unsigned integers at the smallest width (1, 2 or 4 bytes) that holds the largest of them.
class CompactArray {
 public:
  CompactArray() = default;
  /// \param values_below every value that will be stored is smaller than this.
  CompactArray(std::int64_t size, std::uint64_t values_below)
      : width_(values_below <= 0x100     ? 1
               : values_below <= 0x10000 ? 2
                                         : 4),
        bytes_(static_cast<std::size_t>(size) * width_) {}

  [[nodiscard]] std::int64_t size() const { return static_cast<std::int64_t>(bytes_.size() / width_); }
  [[nodiscard]] int width() const { return static_cast<int>(width_); }
  [[nodiscard]] std::uint32_t operator[](std::int64_t i) const {
    const std::uint8_t* p = bytes_.data() + static_cast<std::size_t>(i) * width_;
    if (width_ == 1) return *p;
    if (width_ == 2) return load<std::uint16_t>(p);
    return load<std::uint32_t>(p);
  }
  /// Room for so many values in all, which takes memory as resize() uses it.
  void reserve(std::int64_t size) { bytes_.reserve(static_cast<std::size_t>(size) * width_); }
  /// New values are 0.
  void resize(std::int64_t size) { bytes_.resize(static_cast<std::size_t>(size) * width_); }
  void set(std::int64_t i, std::uint32_t value) {
    std::memcpy(bytes_.data() + static_cast<std::size_t>(i) * width_, &value, width_);  // little endian
  }
  /// Calls f with a pointer to the values at their own width: the way for hot loops to avoid the branch.
  template <class F>
  decltype(auto) visit(F&& f) const {
    if (width_ == 1) return f(bytes_.data());
    if (width_ == 2) return f(reinterpret_cast<const std::uint16_t*>(bytes_.data()));
    return f(reinterpret_cast<const std::uint32_t*>(bytes_.data()));
  }
  /// The same with a pointer through which values may be changed.
  template <class F>
  decltype(auto) visit(F&& f) {
    if (width_ == 1) return f(bytes_.data());
    if (width_ == 2) return f(reinterpret_cast<std::uint16_t*>(bytes_.data()));
    return f(reinterpret_cast<std::uint32_t*>(bytes_.data()));
  }

 private:
  template <class T>
  static std::uint32_t load(const std::uint8_t* p) {
    T v;
    std::memcpy(&v, p, sizeof v);
    return v;
  }
  std::size_t width_ = 1;
  std::vector<std::uint8_t> bytes_;
};

/// A segmented image of any dimension.
template <int Dim>
struct LabelImage {
  Coord<Dim> extent{};               ///< voxels per axis, first axis fastest in `voxels`
  Frame<Dim> frame;                  ///< place in the world
  CompactArray voxels;               ///< material of each voxel
  std::vector<std::int32_t> labels;  ///< the file's value of each material
  std::vector<std::string> names;    ///< name of each material, or empty as a whole where none are known

  [[nodiscard]] MaterialId material(const Coord<Dim>& voxel) const { return voxels[linear_index(voxel, extent)]; }
  /// Centre of a voxel, and the voxel at a point or next to it, in the inner frame.
  [[nodiscard]] Vec<Dim> centre(const Coord<Dim>& voxel) const {
    Vec<Dim> x;
    for (int d = 0; d < Dim; ++d) x[d] = (voxel[d] + 0.5) * frame.spacing[d];
    return x;
  }
  [[nodiscard]] Coord<Dim> voxel_at(const Vec<Dim>& x) const {
    Coord<Dim> voxel;
    for (int d = 0; d < Dim; ++d)
      voxel[d] = static_cast<std::int32_t>(std::clamp(std::floor(x[d] / frame.spacing[d]), 0.0, extent[d] - 1.0));
    return voxel;
  }
  [[nodiscard]] double voxel_volume() const {
    double volume = 1;
    for (const double side : frame.spacing) volume *= side;
    return volume;
  }
  /// Physical sides of the whole image: the box that a mesh of it fills, from 0 in the inner frame.
  [[nodiscard]] Vec<Dim> size() const {
    Vec<Dim> s{};
    for (int d = 0; d < Dim; ++d) s[d] = extent[d] * frame.spacing[d];
    return s;
  }
};

/// The material with a label, or kOutside where there is none.
MaterialId material_of(const std::vector<std::int32_t>& labels, std::int32_t label);

/// Makes a label image of plain values: numbers the materials by first appearance.
/// \pre values.size() equals the product of the extent.
template <int Dim>
LabelImage<Dim> make_label_image(const Coord<Dim>& extent, const std::vector<std::int32_t>& values,
                                 const Frame<Dim>& frame = {});

/// A grey-value image in the same layout.
template <int Dim>
struct GreyImage {
  Coord<Dim> extent{};
  Frame<Dim> frame;
  std::vector<float> values;
};

}  // namespace treemarch
