/// \file
/// Separating functions: what weight each label has at a point. Interfaces are where the two largest weights are equal.
/// See docs/stages/field.md; the solid angle is the paper's equation 1.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/vec.h"
#include "treemarch/field/bricks.h"
#include "treemarch/image/label_image.h"

namespace treemarch {

enum class FieldKind {
  linear,       ///< d-linear interpolation of the indicators at voxel centres
  bspline3,     ///< cubic B-spline of the indicators (smoothing, not interpolating)
  gauss,        ///< Gaussian of each indicator, d-linear between voxel centres
  dgf,          ///< 2 G - H, H a wider Gaussian: as smooth, with less shrinking
  grey,         ///< labels, with the surface of the foreground where a grey value meets a threshold
  solid_angle,  ///< the share of directions around a point that see the label
};

/// Of the smoothing, in voxels. The normals of a voxelised ball of 6 voxels are within 6 degrees (RMS) at 1.04, not at
/// 1; labels of an atlas lose Dice above (0.987 at 1, 0.986 at 1.05, 0.982 at 1.1).
inline constexpr double kDefaultSigma = 1.04;

struct FieldOptions {
  FieldKind kind = FieldKind::dgf;
  double sigma = kDefaultSigma;  ///< of gauss and dgf, in voxels along each axis; 0.25 to 4
  bool keep_thin = true;         ///< sheets, wires and grains too thin for the field keep their raw indicator
  std::int32_t background = 0;   ///< label value that a grey value tells from all others
  /// Factor of the weight of each material, 0.5 to 2, or empty for 1: a larger one makes the material grow. Not of
  /// solid_angle and grey.
  std::vector<float> scale;
};

struct LabelWeight {
  MaterialId material;
  float weight;
};

struct ValueAndSlope {
  float value, slope;
};

/// A separating function for every label of an image. Points are in the inner frame (image/frame.h); beyond the image
/// the nearest voxel centre counts, so labels extend constantly over the border. Weights are >= 0 and about 1 where one
/// label is alone (thin structures count up to 1.9 times, docs/stages/field.md); labels that weigh less than 1/512 at a
/// voxel are left out there. The result for a label depends neither on the numbering of labels nor on threads. All
/// functions are safe to call from many threads.
template <int Dim>
class Field {
 public:
  /// Labels at a point, the largest weight first, equal weights in the order of the materials.
  /// \param out room for the result; the smallest weights are left out if it is too short.
  /// \return number of entries written, at least 1. \pre !out.empty()
  int sample(const Vec<Dim>& x, std::span<LabelWeight> out) const;
  /// Weight of one material at a point, 0 where it is unknown.
  [[nodiscard]] float weight(const Vec<Dim>& x, MaterialId m) const;
  /// weight(x, a) - weight(x, b), at the price of one.
  [[nodiscard]] float difference(const Vec<Dim>& x, MaterialId a, MaterialId b) const;
  /// The same with its derivative along a direction, from one look; 0 where that takes more (bspline3).
  [[nodiscard]] ValueAndSlope difference_along(const Vec<Dim>& x, const Vec<Dim>& direction, MaterialId a,
                                               MaterialId b) const;
  /// The image's own material of the voxel that holds the point (the upper one on a voxel face).
  [[nodiscard]] MaterialId voxel_label(const Vec<Dim>& x) const;
  /// The material that is alone everywhere in a box, or kOutside if none is known to be. Costs a look at one word for
  /// every 64 voxels; may miss boxes near an interface.
  [[nodiscard]] MaterialId uniform_label(const Vec<Dim>& low, const Vec<Dim>& high) const;
  /// Whether the field makes sense at lattice points only and is to be interpolated linearly along edges between them.
  [[nodiscard]] bool linear_along_edges() const { return kind_ == FieldKind::solid_angle; }
  [[nodiscard]] FieldKind kind() const { return kind_; }
  /// Sides of a voxel.
  [[nodiscard]] const Vec<Dim>& spacing() const { return spacing_; }
  /// Bytes held.
  [[nodiscard]] std::size_t memory() const;
  [[nodiscard]] const Bricks<Dim>& bricks() const { return bricks_; }

  Field() = default;
  /// For build_field().
  Field(FieldKind kind, const Vec<Dim>& spacing, Bricks<Dim> bricks)
      : kind_(kind), spacing_(spacing), bricks_(std::move(bricks)) {}

 private:
  FieldKind kind_ = FieldKind::linear;
  Vec<Dim> spacing_{};
  Bricks<Dim> bricks_;
};

/// The field of a label image.
/// \throw Error(usage) if sigma is out of range or the kind is grey.
template <int Dim>
Field<Dim> build_field(const LabelImage<Dim>& image, const FieldOptions& options, Execution& execution);

/// The field of a label image whose foreground (every label but options.background) ends where `grey` meets the
/// threshold, within a voxel of where the labels put its end; the labels share the foreground by their indicators. The
/// foreground is on the side of the threshold where its mean grey value lies. For a grey image alone let `image` be the
/// thresholded one. options.kind is ignored, options.sigma smooths the indicators that share the foreground.
/// \throw Error(input) if the extents differ.
template <int Dim>
Field<Dim> build_grey_field(const LabelImage<Dim>& image, const GreyImage<Dim>& grey, double threshold,
                            const FieldOptions& options, Execution& execution);

}  // namespace treemarch
