/// \file
/// Where a vertex may go: the interface, junction and sides of the box that it lies on.
#pragma once

#include <array>
#include <span>

#include "treemarch/core/vec.h"
#include "treemarch/field/field.h"
#include "treemarch/improve/patch.h"

namespace treemarch {

/// Materials and sides of the box around a vertex.
struct Stratum {
  static constexpr int kMost = 8;
  std::array<MaterialId, kMost> material{};  ///< ascending
  int count = 0;                             ///< at most kMost; more are left out
  unsigned fixed_axes = 0;                   ///< bit d: on a side of the box normal to axis d
  bool open = false;                         ///< beside a hull facet that is not on the box

  [[nodiscard]] std::span<const MaterialId> materials() const { return {material.data(), std::size_t(count)}; }
  void add(MaterialId m);
};

/// Bit d is set where x lies on a side of the box [0, box] normal to axis d.
template <int Dim>
unsigned box_axes(const Vec<Dim>& x, const Vec<Dim>& box);

/// \pre patch.has_star(v)
template <int Dim>
Stratum stratum_of(const Patch<Dim>& patch, VertexId v, const Vec<Dim>& box, const Field<Dim>& field);

/// The linearised conditions of a stratum near a point: the weights of its materials are equal, fixed axes stay.
template <int Dim>
class Constraint {
 public:
  Constraint(const Field<Dim>& field, const Stratum& stratum, const Vec<Dim>& x);

  /// Directions left: Dim inside, 0 at a point that is fixed.
  [[nodiscard]] int freedom() const { return freedom_; }
  /// Whether the field tells how far a point is from the stratum.
  [[nodiscard]] bool known() const { return known_; }
  /// The part of a direction along the stratum.
  [[nodiscard]] Vec<Dim> along(Vec<Dim> d) const;
  /// The part of a direction that keeps the fixed axes.
  [[nodiscard]] Vec<Dim> on_box(Vec<Dim> d) const;
  /// The shortest move from y to the stratum, by one Newton step. 0 inside. \pre known()
  [[nodiscard]] Vec<Dim> to_stratum(const Vec<Dim>& y) const;

 private:
  using Residual = std::array<double, Stratum::kMost>;
  [[nodiscard]] Residual residual(const Vec<Dim>& x) const;

  const Field<Dim>& field_;
  const Stratum& stratum_;
  int rows_ = 0;
  std::array<Vec<Dim>, Dim> jacobian_{};
  std::array<Vec<Dim>, Dim> normal_{};  // orthonormal basis of the rows
  int freedom_ = Dim;
  bool known_ = true;
};

}  // namespace treemarch
