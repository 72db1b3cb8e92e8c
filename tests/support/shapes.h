/// \file
/// Random images of many kinds, for tests of what must hold for any image.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch::testing {

/// Kinds of random images.
enum class Shapes { noise, blobs, cells, sheets, wires, pinches };
inline constexpr int kShapeKinds = 6;

/// Paints random shapes of `labels` labels (0 the background) into an image.
template <int Dim>
class ShapePainter {
 public:
  ShapePainter(const Coord<Dim>& extent, int labels, unsigned seed)
      : extent_(extent), labels_(labels), random_(seed), values_(static_cast<std::size_t>(product(extent)), 0) {}

  LabelImage<Dim> paint(Shapes kind) {
    const int count = 1 + below(2 * labels_);
    switch (kind) {
      case Shapes::noise:
        for (auto& v : values_) v = below(labels_);
        break;
      case Shapes::cells:
        paint_cells();
        break;
      case Shapes::blobs:
        for (int i = 0; i < count; ++i) ball(place(), 1 + uniform() * 0.3 * smallest(), label());
        break;
      case Shapes::sheets:
        for (int i = 0; i < 1 + count / 3; ++i) sheet(place(), direction(), 0.5 + uniform(), label());
        break;
      case Shapes::wires:
        for (int i = 0; i < count; ++i) wire(label());
        break;
      case Shapes::pinches:
        for (int i = 0; i < count; ++i) ball(place(), 1 + uniform() * 0.2 * smallest(), label());
        for (int i = 0; i < 2 * count; ++i) diagonal(label());
        break;
    }
    return make_label_image(extent_, values_);
  }

 private:
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }
  double uniform() { return static_cast<double>(random_()) / 4294967296.0; }
  std::int32_t label() { return 1 + below(std::max(1, labels_ - 1)); }
  double smallest() const { return *std::ranges::min_element(extent_); }
  Vec<Dim> place() {
    Vec<Dim> x{};
    for (int d = 0; d < Dim; ++d) x[d] = uniform() * extent_[d];
    return x;
  }
  Vec<Dim> direction() {
    Vec<Dim> n{};
    do {
      for (int d = 0; d < Dim; ++d) n[d] = below(3) == 0 ? 0 : 2 * uniform() - 1;
    } while (norm(n) < 0.1);
    return (1 / norm(n)) * n;
  }
  Coord<Dim> voxel() {
    Coord<Dim> c{};
    for (int d = 0; d < Dim; ++d) c[d] = below(extent_[d]);
    return c;
  }
  void set(const Coord<Dim>& c, std::int32_t value) {
    for (int d = 0; d < Dim; ++d)
      if (c[d] < 0 || c[d] >= extent_[d]) return;
    values_[static_cast<std::size_t>(linear_index(c, extent_))] = value;
  }
  template <class Inside>
  void fill(Inside&& inside, std::int32_t value) {
    for (std::int64_t i = 0; i < product(extent_); ++i) {
      const Coord<Dim> c = coord_of(i, extent_);
      Vec<Dim> x{};
      for (int d = 0; d < Dim; ++d) x[d] = c[d] + 0.5;
      if (inside(x)) values_[static_cast<std::size_t>(i)] = value;
    }
  }
  void ball(const Vec<Dim>& centre, double radius, std::int32_t value) {
    fill([&](const Vec<Dim>& x) { return norm(x - centre) < radius; }, value);
  }
  void sheet(const Vec<Dim>& through, const Vec<Dim>& normal, double thickness, std::int32_t value) {
    fill([&](const Vec<Dim>& x) { return std::abs(dot(x - through, normal)) < 0.5 * thickness; }, value);
  }
  /// The regions nearest to random places.
  void paint_cells() {
    std::vector<Vec<Dim>> seeds(static_cast<std::size_t>(2 * labels_));
    for (auto& s : seeds) s = place();
    for (std::size_t s = 0; s < seeds.size(); ++s)
      fill(
          [&](const Vec<Dim>& x) {
            return std::ranges::all_of(seeds, [&](const Vec<Dim>& o) { return norm(x - seeds[s]) <= norm(x - o); });
          },
          static_cast<std::int32_t>(s) % labels_);
  }
  /// A walk over the faces of voxels.
  void wire(std::int32_t value) {
    Coord<Dim> c = voxel();
    int axis = 0, step = 1;
    for (int i = 0; i < 2 * static_cast<int>(smallest()); ++i) {
      set(c, value);
      if (below(3) == 0) axis = below(Dim), step = 2 * below(2) - 1;
      c[axis] += step;
    }
  }
  /// A walk over edges and corners.
  void diagonal(std::int32_t value) {
    Coord<Dim> c = voxel(), step{};
    for (int d = 0; d < Dim; ++d) step[d] = below(3) - 1;
    for (int i = 0; i < 1 + below(5); ++i) {
      set(c, value);
      for (int d = 0; d < Dim; ++d) c[d] += step[d];
    }
  }

  Coord<Dim> extent_;
  int labels_;
  std::mt19937 random_;
  std::vector<std::int32_t> values_;
};

}  // namespace treemarch::testing
