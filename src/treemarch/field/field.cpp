#include "treemarch/field/field.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace treemarch {

namespace {

/// The voxels along one axis that have a say at a point, and how much.
template <int Taps>
struct AxisTaps {
  std::int32_t voxel[Taps];
  double weight[Taps];
};

std::int32_t clamp_voxel(double v, std::int32_t extent) {
  // In double first: a point far outside must not overflow the integer.
  return static_cast<std::int32_t>(std::clamp(v, 0.0, static_cast<double>(extent - 1)));
}

AxisTaps<2> linear_taps(double u, std::int32_t extent) {
  const double t = std::clamp(u - 0.5, 0.0, extent - 1.0);
  const auto voxel = static_cast<std::int32_t>(t);  // rounds down, and without a call, as t >= 0
  const double f = t - voxel;
  return {{voxel, std::min(voxel + 1, extent - 1)}, {1 - f, f}};
}

AxisTaps<2> solid_angle_taps(double u, std::int32_t extent) {
  constexpr double kOnFace = 1e-6;  // voxels
  const double face = std::round(u);
  if (std::abs(u - face) < kOnFace) return {{clamp_voxel(face - 1, extent), clamp_voxel(face, extent)}, {0.5, 0.5}};
  const std::int32_t v = clamp_voxel(std::floor(u), extent);
  return {{v, v}, {1, 0}};
}

AxisTaps<4> bspline_taps(double u, std::int32_t extent) {
  const double base = std::floor(u - 0.5);
  const double f = u - 0.5 - base;
  const double g = 1 - f;
  AxisTaps<4> t;
  for (int k = 0; k < 4; ++k) t.voxel[k] = clamp_voxel(base - 1 + k, extent);
  // Each pair of mirrored taps is evaluated by the same expression, so that mirrored points get mirrored weights.
  t.weight[0] = g * g * g / 6;
  t.weight[1] = (4 - 3 * f * f * (1 + g)) / 6;
  t.weight[2] = (4 - 3 * g * g * (1 + f)) / 6;
  t.weight[3] = f * f * f / 6;
  return t;
}

/// The bricks around a point: the taps lie in one or two along each axis.
template <int Dim, int Taps>
struct BricksAround {
  static constexpr int kCorners = 1 << Dim;
  std::uint64_t ref[kCorners];
  bool same = true;  ///< one brick, or several uniform ones of one label

  BricksAround(const Bricks<Dim>& bricks, const AxisTaps<Taps> (&taps)[Dim]) {
    constexpr int kShift = Bricks<Dim>::kShift;
    std::int64_t first = 0;
    std::int64_t step[Dim];
    std::int64_t stride = 1;
    for (int d = 0; d < Dim; ++d) {
      const std::int32_t low = taps[d].voxel[0] >> kShift;
      first += low * stride;
      step[d] = ((taps[d].voxel[Taps - 1] >> kShift) - low) * stride;
      stride *= bricks.brick_extent[d];
    }
    for (int corner = 0; corner < kCorners; ++corner) {
      std::int64_t brick = first;
      for (int d = 0; d < Dim; ++d) brick += (corner >> d & 1) != 0 ? step[d] : 0;
      ref[corner] = bricks.refs[brick];
      same &= ref[corner] == ref[0];
    }
  }
};

/// Calls visit(corner, place, weight) for every voxel that has a say: the corner of BricksAround, the place in that
/// brick.
template <int Dim, int Taps, class Visit>
[[gnu::always_inline]] inline void visit_taps(const AxisTaps<Taps> (&taps)[Dim], Visit&& visit) {
  constexpr int kShift = Bricks<Dim>::kShift;
  constexpr int kMask = Bricks<Dim>::kSide - 1;
  const auto upper = [&](int d, int tap) {
    return (taps[d].voxel[tap] ^ taps[d].voxel[0]) >> kShift != 0 ? 1 << d : 0;
  };
  for (int outer = 0; outer < (Dim == 3 ? Taps * Taps : Taps); ++outer) {
    const int j = outer % Taps;
    double weight = taps[1].weight[j];
    int place = (taps[1].voxel[j] & kMask) << kShift;
    int corner = upper(1, j);
    if constexpr (Dim == 3) {
      const int k = outer / Taps;
      weight *= taps[2].weight[k];
      place |= (taps[2].voxel[k] & kMask) << (2 * kShift);
      corner |= upper(2, k);
    }
    for (int i = 0; i < Taps; ++i)
      visit(corner | upper(0, i), place | (taps[0].voxel[i] & kMask), weight * taps[0].weight[i]);
  }
}

/// Weights of the only two labels around a point.
struct PairWeights {
  MaterialId material[2];
  double weight[2];
};

/// The two weights at a point if all bricks around it are of the same two labels (by far the most frequent case, and
/// one without a branch a voxel).
template <int Dim, int Taps>
[[gnu::always_inline]] inline bool pair_weights(const Bricks<Dim>& bricks, const BricksAround<Dim, Taps>& around,
                                                const AxisTaps<Taps> (&taps)[Dim], PairWeights& result) {
  constexpr int kCorners = BricksAround<Dim, Taps>::kCorners;
  const std::uint32_t* brick[kCorners];
  if (around.same) {
    if ((around.ref[0] & Bricks<Dim>::kPair) == 0) return false;
    std::fill_n(brick, kCorners, bricks.data(around.ref[0]));
  } else {
    std::uint64_t all = around.ref[0];
    for (std::uint64_t ref : around.ref) all &= ref;
    if ((all & Bricks<Dim>::kPair) == 0) return false;
    bool equal = true;
    for (int corner = 0; corner < kCorners; ++corner) {
      brick[corner] = bricks.data(around.ref[corner]);
      equal &= brick[corner][0] == brick[0][0] && brick[corner][1] == brick[0][1];
    }
    if (!equal) return false;
  }
  double first = 0;
  double second = 0;
  visit_taps(taps, [&](int corner, int place, double w) {
    const std::uint32_t word = brick[corner][Bricks<Dim>::kPairHeader + place];
    first += w * static_cast<std::int32_t>(word & 0xffffU);
    second += w * static_cast<std::int32_t>(word >> 16);
  });
  result = {{brick[0][0], brick[0][1]}, {first / Bricks<Dim>::kOne, second / Bricks<Dim>::kOne}};
  return true;
}

/// Sums of weights by material, in the order in which they come.
class Sums {
 public:
  void add(MaterialId material, double weight) {
    for (int i = 0; i < size_; ++i)
      if (material_[i] == material) {
        weight_[i] += weight;
        return;
      }
    if (size_ == kCapacity) return;
    material_[size_] = material;
    weight_[size_++] = weight;
  }
  /// Writes the largest, in order.
  int write(std::span<LabelWeight> out) const {
    int n = 0;
    for (int i = 0; i < size_; ++i) {
      const LabelWeight entry{material_[i], static_cast<float>(weight_[i])};
      if (entry.weight <= 0) continue;
      int at = n;
      while (at > 0 && before(entry, out[at - 1])) --at;
      if (at == static_cast<int>(out.size())) continue;
      n = std::min(n + 1, static_cast<int>(out.size()));
      for (int j = n - 1; j > at; --j) out[j] = out[j - 1];
      out[at] = entry;
    }
    return n;
  }

 private:
  static bool before(const LabelWeight& a, const LabelWeight& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.material < b.material;
  }
  static constexpr int kCapacity = 256;  // 8 voxels of at most 32 entries, or 64 of one
  int size_ = 0;
  MaterialId material_[kCapacity];
  double weight_[kCapacity];
};

template <int Dim, int Taps>
int sample_taps(const Bricks<Dim>& bricks, const AxisTaps<Taps> (&taps)[Dim], std::span<LabelWeight> out) {
  const BricksAround<Dim, Taps> around(bricks, taps);
  if (around.same && (around.ref[0] & Bricks<Dim>::kUniform) != 0) {
    out[0] = {static_cast<MaterialId>(around.ref[0]), 1.0F};
    return 1;
  }
  Sums sums;
  PairWeights pair;
  if (pair_weights(bricks, around, taps, pair)) {
    for (int i = 0; i < 2; ++i) sums.add(pair.material[i], pair.weight[i]);
  } else {
    visit_taps(taps, [&](int corner, int place, double w) {
      if (w == 0) return;
      bricks.visit_voxel(around.ref[corner], place, [&](MaterialId m, std::uint32_t weight) {
        sums.add(m, w * (static_cast<std::int32_t>(weight) * (1.0 / Bricks<Dim>::kOne)));
      });
    });
  }
  return sums.write(out);
}

/// weight(a) - weight(b); b may be kOutside, which weighs nothing.
template <int Dim, int Taps>
float difference_taps(const Bricks<Dim>& bricks, const AxisTaps<Taps> (&taps)[Dim], MaterialId a, MaterialId b) {
  const BricksAround<Dim, Taps> around(bricks, taps);
  double sum_a = 0;
  double sum_b = 0;
  const auto add = [&](MaterialId m, double w) {
    sum_a += m == a ? w : 0;
    sum_b += m == b ? w : 0;
  };
  PairWeights pair;
  if (around.same && (around.ref[0] & Bricks<Dim>::kUniform) != 0) {
    add(static_cast<MaterialId>(around.ref[0]), 1);
  } else if (pair_weights(bricks, around, taps, pair)) {
    for (int i = 0; i < 2; ++i) add(pair.material[i], pair.weight[i]);
  } else {
    visit_taps(taps, [&](int corner, int place, double w) {
      if (w == 0) return;
      bricks.visit_voxel(around.ref[corner], place, [&](MaterialId m, std::uint32_t weight) {
        add(m, w * (static_cast<std::int32_t>(weight) * (1.0 / Bricks<Dim>::kOne)));
      });
    });
  }
  return static_cast<float>(sum_a - sum_b);
}

/// Calls use(taps) with the taps of the field's kind at a point.
template <int Dim, class Use>
auto with_taps(FieldKind kind, const Vec<Dim>& x, const Vec<Dim>& spacing, const Coord<Dim>& extent, Use&& use) {
  if (kind == FieldKind::bspline3) {
    AxisTaps<4> taps[Dim];
    for (int d = 0; d < Dim; ++d) taps[d] = bspline_taps(x[d] / spacing[d], extent[d]);
    return use(taps);
  }
  AxisTaps<2> taps[Dim];
  for (int d = 0; d < Dim; ++d)
    taps[d] = kind == FieldKind::solid_angle ? solid_angle_taps(x[d] / spacing[d], extent[d])
                                             : linear_taps(x[d] / spacing[d], extent[d]);
  return use(taps);
}

}  // namespace

template <int Dim>
int Field<Dim>::sample(const Vec<Dim>& x, std::span<LabelWeight> out) const {
  return with_taps(kind_, x, spacing_, bricks_.extent,
                   [&](const auto& taps) { return sample_taps(bricks_, taps, out); });
}

template <int Dim>
float Field<Dim>::weight(const Vec<Dim>& x, MaterialId m) const {
  return difference(x, m, kOutside);
}

template <int Dim>
float Field<Dim>::difference(const Vec<Dim>& x, MaterialId a, MaterialId b) const {
  return with_taps(kind_, x, spacing_, bricks_.extent,
                   [&](const auto& taps) { return difference_taps(bricks_, taps, a, b); });
}

template <int Dim>
MaterialId Field<Dim>::voxel_label(const Vec<Dim>& x) const {
  Coord<Dim> voxel{};
  for (int d = 0; d < Dim; ++d) voxel[d] = clamp_voxel(std::floor(x[d] / spacing_[d]), bricks_.extent[d]);
  return bricks_.own(voxel);
}

template <int Dim>
MaterialId Field<Dim>::uniform_label(const Vec<Dim>& low, const Vec<Dim>& high) const {
  Coord<Dim> first{};
  Coord<Dim> count{};
  const int reach = kind_ == FieldKind::bspline3 ? 2 : 1;
  for (int d = 0; d < Dim; ++d) {
    const std::int32_t a = clamp_voxel(std::floor(low[d] / spacing_[d] - 0.5) - (reach - 1), bricks_.extent[d]);
    const std::int32_t b = clamp_voxel(std::floor(high[d] / spacing_[d] - 0.5) + reach, bricks_.extent[d]);
    first[d] = a >> Bricks<Dim>::kShift;
    count[d] = (b >> Bricks<Dim>::kShift) - first[d] + 1;
  }
  const std::uint64_t ref = bricks_.refs[linear_index(first, bricks_.brick_extent)];
  if (!(ref & Bricks<Dim>::kUniform)) return kOutside;
  const std::int64_t n = product(count);
  for (std::int64_t i = 1; i < n; ++i) {
    Coord<Dim> brick = coord_of(i, count);
    for (int d = 0; d < Dim; ++d) brick[d] += first[d];
    if (bricks_.refs[linear_index(brick, bricks_.brick_extent)] != ref) return kOutside;
  }
  return static_cast<MaterialId>(ref);
}

template <int Dim>
std::size_t Field<Dim>::memory() const {
  std::size_t bytes = bricks_.refs.capacity() * sizeof(std::uint64_t);
  for (const auto& chunk : bricks_.chunks) bytes += sizeof chunk + chunk.capacity() * sizeof(std::uint32_t);
  return bytes;
}

template class Field<2>;
template class Field<3>;

}  // namespace treemarch
