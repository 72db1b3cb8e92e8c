#include "treemarch/field/field.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace treemarch {

namespace {

/// Rounds down.
std::int32_t clamp_voxel(double v, std::int32_t extent) {
  // In double first: a point far outside must not overflow the integer. What is not negative is rounded without a call.
  return static_cast<std::int32_t>(std::clamp(v, 0.0, static_cast<double>(extent - 1)));
}

/// What counts along one axis: a voxel with weight 1 - f and the next one with f.
struct Tap {
  std::int32_t voxel;
  double f;
};

Tap linear_tap(double u, std::int32_t extent) {
  const double t = std::clamp(u - 0.5, 0.0, extent - 1.0);
  const auto voxel = static_cast<std::int32_t>(t);  // rounds down, and without a call, as t >= 0
  return {voxel, t - voxel};
}

Tap solid_angle_tap(double u, std::int32_t extent) {
  constexpr double kOnFace = 1e-6;  // voxels
  const double face = std::round(u);
  if (std::abs(u - face) < kOnFace && face > 0 && face < extent) return {static_cast<std::int32_t>(face) - 1, 0.5};
  return {clamp_voxel(u, extent), 0};
}

/// The cell of voxel centres around a point, and where in it the point lies.
template <int Dim>
struct Cell {
  static constexpr int kCorners = 1 << Dim;
  std::uint64_t ref;        ///< of the brick that holds the cell; the rest is for bricks that are not uniform
  int place = 0;            ///< of the cell's first voxel in the brick
  double f[Dim];            ///< where in the cell the point is along each axis, 0 to 1
  double weight[kCorners];  ///< of each voxel, first axis fastest

  static constexpr std::array<int, kCorners> kOffset = [] {
    std::array<int, kCorners> offset{};
    for (int corner = 0; corner < kCorners; ++corner)
      for (int d = 0, stride = 1; d < Dim; ++d, stride *= Bricks<Dim>::kReach)
        offset[corner] += (corner >> d & 1) * stride;
    return offset;
  }();

  Cell(const Bricks<Dim>& bricks, FieldKind kind, const Vec<Dim>& x, const Vec<Dim>& spacing) {
    Coord<Dim> voxel;
    for (int d = 0; d < Dim; ++d) {
      const double u = x[d] / spacing[d];
      const Tap tap =
          kind == FieldKind::solid_angle ? solid_angle_tap(u, bricks.extent[d]) : linear_tap(u, bricks.extent[d]);
      voxel[d] = tap.voxel;
      f[d] = tap.f;
    }
    ref = bricks.refs[bricks.brick_of(voxel)];
    if (ref & Bricks<Dim>::kUniform) return;
    place = Bricks<Dim>::place_in_brick(voxel);
    weight[0] = 1.0 / Bricks<Dim>::kOne;
    for (int d = Dim; d-- > 0;)
      for (int corner = (kCorners >> d) - 2; corner >= 0; corner -= 2) {
        const double w = weight[corner / 2];
        weight[corner + 1] = w * f[d];
        weight[corner] = w * (1 - f[d]);
      }
  }
};

/// Writes label weights in order, the largest first.
class Largest {
 public:
  explicit Largest(std::span<LabelWeight> out) : out_(out) {}
  void put(MaterialId material, double weight) {
    const LabelWeight entry{material, static_cast<float>(weight)};
    if (entry.weight <= 0) return;
    const int room = static_cast<int>(out_.size());
    int at = size_;
    while (at > 0 && before(entry, out_[at - 1])) --at;
    if (at == room) return;
    size_ = std::min(size_ + 1, room);
    for (int j = size_ - 1; j > at; --j) out_[j] = out_[j - 1];
    out_[at] = entry;
  }
  [[nodiscard]] int size() const { return size_; }

 private:
  static bool before(const LabelWeight& a, const LabelWeight& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.material < b.material;
  }
  std::span<LabelWeight> out_;
  int size_ = 0;
};

/// Sums of weights by material.
class Sums {
 public:
  void add(MaterialId material, double weight) {
    for (int i = 0; i < size_; ++i)
      if (material_[i] == material) {
        weight_[i] += weight;
        return;
      }
    material_[size_] = material;
    weight_[size_++] = weight;
  }
  template <class Visit>
  void visit(Visit&& visit) const {
    for (int i = 0; i < size_; ++i) visit(material_[i], weight_[i]);
  }

 private:
  static constexpr int kCapacity = 8 * 33;  // 8 voxels of at most 33 entries
  int size_ = 0;
  MaterialId material_[kCapacity];
  double weight_[kCapacity];
};

/// Calls add(material, weight) for the labels of a cell, each once unless the brick has more than 8.
template <int Dim, int Slots, class Add>
void visit_table(const std::uint32_t* brick, const Cell<Dim>& cell, Add&& add) {
  constexpr int kWords = Slots / 2;
  const std::uint32_t* table = brick + Slots + Bricks<Dim>::kOwnWords + cell.place * kWords;
  double sum[Slots] = {};
  for (int corner = 0; corner < Cell<Dim>::kCorners; ++corner)
    for (int i = 0; i < kWords; ++i) {
      const std::uint32_t word = table[Cell<Dim>::kOffset[corner] * kWords + i];
      sum[2 * i] += cell.weight[corner] * static_cast<std::int32_t>(word & 0xffffU);
      sum[2 * i + 1] += cell.weight[corner] * static_cast<std::int32_t>(word >> 16);
    }
  for (int i = 0; i < Slots; ++i) add(brick[i], sum[i]);
}

/// Calls add(corner, material, weight) for each label of each voxel of a cell, in units of 1 / kOne.
template <int Dim, class Add>
void visit_lists(const std::uint32_t* brick, const Cell<Dim>& cell, Add&& add) {
  for (int corner = 0; corner < Cell<Dim>::kCorners; ++corner) {
    const int place = cell.place + Cell<Dim>::kOffset[corner];
    for (std::uint32_t i = brick[place]; i < brick[place + 1]; i += 2)
      add(corner, brick[i], static_cast<std::int32_t>(brick[i + 1]));
  }
}

/// Calls add(corner, m, weight) with the weights of the voxels of a cell, in units of 1 / kOne, of the m-th of some
/// materials, for a brick with a table.
template <int Dim, int Slots, std::size_t Count, class Add>
void visit_corners(const std::uint32_t* brick, const Cell<Dim>& cell, const std::array<MaterialId, Count>& materials,
                   Add&& add) {
  constexpr int kWords = Slots / 2;
  const std::uint32_t* table = brick + Slots + Bricks<Dim>::kOwnWords + cell.place * kWords;
  std::array<const std::uint32_t*, Count> column;
  std::array<int, Count> shift;
  std::array<std::uint32_t, Count> mask;
  for (std::size_t m = 0; m < Count; ++m) {
    int slot = 0;
    while (slot < Slots && brick[slot] != materials[m]) ++slot;
    mask[m] = slot == Slots ? 0 : 0xffffU;
    column[m] = table + slot % Slots / 2;
    shift[m] = 16 * (slot % 2);
  }
  for (int corner = 0; corner < Cell<Dim>::kCorners; ++corner)
    for (std::size_t m = 0; m < Count; ++m)
      add(corner, m, static_cast<std::int32_t>(column[m][Cell<Dim>::kOffset[corner] * kWords] >> shift[m] & mask[m]));
}

/// The same for any brick that is not uniform.
template <int Dim, std::size_t Count, class Add>
void visit_corners(const Bricks<Dim>& bricks, const Cell<Dim>& cell, const std::array<MaterialId, Count>& materials,
                   Add&& add) {
  const std::uint32_t* brick = bricks.data(cell.ref);
  switch (Bricks<Dim>::form_of(cell.ref)) {
    case Bricks<Dim>::kTable2:
      return visit_corners<Dim, 2>(brick, cell, materials, add);
    case Bricks<Dim>::kTable4:
      return visit_corners<Dim, 4>(brick, cell, materials, add);
    case Bricks<Dim>::kTable8:
      return visit_corners<Dim, 8>(brick, cell, materials, add);
    default:
      visit_lists(brick, cell, [&](int corner, MaterialId material, std::int32_t w) {
        for (std::size_t m = 0; m < Count; ++m)
          if (materials[m] == material) add(corner, m, w);
      });
  }
}

template <int Dim, std::size_t Count>
std::array<double, Count> cell_weights(const Bricks<Dim>& bricks, const Cell<Dim>& cell,
                                       const std::array<MaterialId, Count>& materials) {
  std::array<double, Count> sum{};
  if (cell.ref & Bricks<Dim>::kUniform) {
    for (std::size_t m = 0; m < Count; ++m) sum[m] = static_cast<MaterialId>(cell.ref) == materials[m] ? 1 : 0;
    return sum;
  }
  visit_corners<Dim, Count>(bricks, cell, materials,
                            [&](int corner, std::size_t m, std::int32_t w) { sum[m] += cell.weight[corner] * w; });
  return sum;
}

/// Of values at the corners of a cell, the value at a point and the derivatives along the axes, per voxel.
template <int Dim>
struct Interpolated {
  double value;
  std::array<double, Dim> slope;

  Interpolated(std::array<double, Cell<Dim>::kCorners> v, const double (&f)[Dim]) {
    std::array<std::array<double, Cell<Dim>::kCorners / 2>, Dim> by_axis;
    int n = Cell<Dim>::kCorners;
    for (int d = 0; d < Dim; ++d) {
      n /= 2;
      for (int i = 0; i < n; ++i) {
        for (int e = 0; e < d; ++e)
          by_axis[e][i] = by_axis[e][2 * i] + f[d] * (by_axis[e][2 * i + 1] - by_axis[e][2 * i]);
        by_axis[d][i] = v[2 * i + 1] - v[2 * i];
        v[i] = v[2 * i] + f[d] * by_axis[d][i];
      }
    }
    value = v[0];
    for (int d = 0; d < Dim; ++d) slope[d] = by_axis[d][0];
  }
};

template <int Dim>
int sample_cell(const Bricks<Dim>& bricks, const Cell<Dim>& cell, std::span<LabelWeight> out) {
  if (cell.ref & Bricks<Dim>::kUniform) {
    out[0] = {static_cast<MaterialId>(cell.ref), 1.0F};
    return 1;
  }
  const std::uint32_t* brick = bricks.data(cell.ref);
  Largest largest(out);
  const auto put = [&](MaterialId m, double w) { largest.put(m, w); };
  switch (Bricks<Dim>::form_of(cell.ref)) {
    case Bricks<Dim>::kTable2:
      visit_table<Dim, 2>(brick, cell, put);
      break;
    case Bricks<Dim>::kTable4:
      visit_table<Dim, 4>(brick, cell, put);
      break;
    case Bricks<Dim>::kTable8:
      visit_table<Dim, 8>(brick, cell, put);
      break;
    default:
      Sums sums;
      visit_lists(brick, cell, [&](int corner, MaterialId m, std::int32_t w) { sums.add(m, cell.weight[corner] * w); });
      sums.visit(put);
  }
  return largest.size();
}

/// Calls add(material, weight) for each of the 4^Dim voxels that have a say in a cubic B-spline.
template <int Dim, class Add>
void visit_bspline(const Bricks<Dim>& bricks, const Vec<Dim>& x, const Vec<Dim>& spacing, Add&& add) {
  std::int32_t voxel[Dim][4];
  double weight[Dim][4];
  for (int d = 0; d < Dim; ++d) {
    const double t = std::clamp(x[d] / spacing[d] - 0.5, -2.0, bricks.extent[d] + 1.0);
    const double base = std::floor(t);
    const double f = t - base;
    const double g = 1 - f;
    for (int k = 0; k < 4; ++k) voxel[d][k] = clamp_voxel(base - 1 + k, bricks.extent[d]);
    // Each pair of mirrored taps is evaluated by the same expression.
    weight[d][0] = g * g * g / 6;
    weight[d][1] = (4 - 3 * f * f * (1 + g)) / 6;
    weight[d][2] = (4 - 3 * g * g * (1 + f)) / 6;
    weight[d][3] = f * f * f / 6;
  }
  for (int i = 0; i < 1 << (2 * Dim); ++i) {
    Coord<Dim> c{};
    double w = 1;
    for (int d = 0; d < Dim; ++d) {
      c[d] = voxel[d][i >> (2 * d) & 3];
      w *= weight[d][i >> (2 * d) & 3];
    }
    add(bricks.own(c), w);
  }
}

}  // namespace

template <int Dim>
int Field<Dim>::sample(const Vec<Dim>& x, std::span<LabelWeight> out) const {
  if (kind_ != FieldKind::bspline3) return sample_cell(bricks_, Cell<Dim>(bricks_, kind_, x, spacing_), out);
  const MaterialId alone = uniform_label(x, x);
  if (alone != kOutside) {
    out[0] = {alone, 1.0F};
    return 1;
  }
  Sums sums;
  visit_bspline(bricks_, x, spacing_, [&](MaterialId m, double w) { sums.add(m, w); });
  Largest largest(out);
  sums.visit([&](MaterialId m, double w) { largest.put(m, w); });
  return largest.size();
}

template <int Dim>
float Field<Dim>::weight(const Vec<Dim>& x, MaterialId m) const {
  if (kind_ != FieldKind::bspline3)
    return static_cast<float>(cell_weights<Dim, 1>(bricks_, Cell<Dim>(bricks_, kind_, x, spacing_), {m})[0]);
  return difference(x, m, kOutside);
}

template <int Dim>
float Field<Dim>::difference(const Vec<Dim>& x, MaterialId a, MaterialId b) const {
  if (kind_ != FieldKind::bspline3) {
    const auto weights = cell_weights<Dim, 2>(bricks_, Cell<Dim>(bricks_, kind_, x, spacing_), {a, b});
    return static_cast<float>(weights[0] - weights[1]);
  }
  double sum_a = 0;
  double sum_b = 0;
  visit_bspline(bricks_, x, spacing_, [&](MaterialId m, double w) {
    sum_a += m == a ? w : 0;
    sum_b += m == b ? w : 0;
  });
  return static_cast<float>(sum_a - sum_b);
}

template <int Dim>
ValueAndSlope Field<Dim>::difference_along(const Vec<Dim>& x, const Vec<Dim>& direction, MaterialId a,
                                           MaterialId b) const {
  if (kind_ == FieldKind::bspline3) return {difference(x, a, b), 0};
  const Cell<Dim> cell(bricks_, kind_, x, spacing_);
  if (cell.ref & Bricks<Dim>::kUniform) {
    const auto weights = cell_weights<Dim, 2>(bricks_, cell, {a, b});
    return {static_cast<float>(weights[0] - weights[1]), 0};
  }
  std::array<double, Cell<Dim>::kCorners> at{};
  visit_corners<Dim, 2>(bricks_, cell, {a, b},
                        [&](int corner, std::size_t m, std::int32_t w) { at[corner] += m == 0 ? w : -w; });
  const Interpolated<Dim> here(at, cell.f);
  double slope = 0;
  for (int d = 0; d < Dim; ++d) {
    const bool is_beyond = x[d] < 0.5 * spacing_[d] || x[d] > (bricks_.extent[d] - 0.5) * spacing_[d];
    if (!is_beyond) slope += direction[d] * here.slope[d] / spacing_[d];
  }
  constexpr double kPerUnit = 1.0 / Bricks<Dim>::kOne;
  return {static_cast<float>(here.value * kPerUnit), static_cast<float>(slope * kPerUnit)};
}

template <int Dim>
MaterialId Field<Dim>::voxel_label(const Vec<Dim>& x) const {
  Coord<Dim> voxel{};
  for (int d = 0; d < Dim; ++d) voxel[d] = clamp_voxel(x[d] / spacing_[d], bricks_.extent[d]);
  return bricks_.own(voxel);
}

template <int Dim>
MaterialId Field<Dim>::uniform_label(const Vec<Dim>& low, const Vec<Dim>& high) const {
  Coord<Dim> first{};
  Coord<Dim> count{};
  const int reach = kind_ == FieldKind::bspline3 ? 1 : 0;  // a brick knows one more layer of voxels
  for (int d = 0; d < Dim; ++d) {
    const std::int32_t a = clamp_voxel(low[d] / spacing_[d] - 0.5 - reach, bricks_.extent[d]);
    const std::int32_t b = clamp_voxel(high[d] / spacing_[d] - 0.5 + reach, bricks_.extent[d]);
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
