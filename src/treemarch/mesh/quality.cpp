#include "treemarch/mesh/quality.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "treemarch/core/parallel.h"
#include "treemarch/core/vector_clones.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/simplex_quality.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 16384;

double to_degrees(double cosine) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  return std::acos(cosine) * kDegrees;
}

/// Angles are compared by their cosines and converted once.
struct CosineRange {
  double of_smallest = -1, of_largest = 1;
  void add(double dot, double squared_lengths) {
    // Something without extent counts as flat.
    if (!(squared_lengths > 0)) {
      of_smallest = 1;
      of_largest = -1;
      return;
    }
    const double c = dot / std::sqrt(squared_lengths);
    of_smallest = std::max(of_smallest, c);
    of_largest = std::min(of_largest, c);
  }
  [[nodiscard]] DegreeRange degrees() const {
    return {to_degrees(std::min(1.0, of_smallest)), to_degrees(std::max(-1.0, of_largest))};
  }
};

void add_angle(const Vec<2>& u, const Vec<2>& v, CosineRange& range) {
  range.add(dot(u, v), squared_norm(u) * squared_norm(v));
}

/// The three dihedral angles at a corner where the edges u, v and w meet.
void add_corner(const Vec<3>& u, const Vec<3>& v, const Vec<3>& w, CosineRange& range) {
  const Vec<3> n[3] = {cross(u, v), cross(v, w), cross(w, u)};  // all outwards or all inwards
  for (int i = 0; i < 3; ++i) {
    const Vec<3>& a = n[i];
    const Vec<3>& b = n[(i + 1) % 3];
    range.add(-dot(a, b), squared_norm(a) * squared_norm(b));
  }
}

CosineRange tetrahedron_cosines(const std::array<Vec<3>, 4>& p) {
  const Vec<3> u = p[1] - p[0], v = p[2] - p[0], w = p[3] - p[0];
  const Vec<3> n[4] = {cross(v, u), cross(u, w), cross(w, v), cross(p[2] - p[1], p[3] - p[1])};
  CosineRange range;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < i; ++j) range.add(-dot(n[i], n[j]), squared_norm(n[i]) * squared_norm(n[j]));
  return range;
}

using Lanes [[gnu::vector_size(32)]] = double;
constexpr int kLanes = sizeof(Lanes) / sizeof(double);

/// Corners of as many tetrahedra as there are lanes: each coordinate of each corner of all of them.
using TetrahedronGroup = std::array<std::array<std::array<double, kLanes>, 3>, 4>;
using GroupCosines = std::array<std::array<double, kLanes>, 2>;  // of_smallest, of_largest

/// The same bits as tetrahedron_cosines(). \tparam T vector type of kLanes numbers
template <class T>
[[gnu::always_inline]] inline void find_cosines(const TetrahedronGroup& group, GroupCosines& cosines) {
  using Vector = std::array<T, 3>;
  std::array<Vector, 4> p, n;
  std::memcpy(&p, &group, sizeof p);
  const auto set_normal = [&](int i, int from, int a, int b) {
    Vector u, v;
    for (int d = 0; d < 3; ++d) u[d] = p[a][d] - p[from][d], v[d] = p[b][d] - p[from][d];
    n[i] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  };
  set_normal(0, 0, 2, 1);
  set_normal(1, 0, 1, 3);
  set_normal(2, 0, 3, 2);
  set_normal(3, 1, 2, 3);
  T squared[4], of_smallest = T{} - 1, of_largest = T{} + 1;
  for (int i = 0; i < 4; ++i) squared[i] = n[i][0] * n[i][0] + n[i][1] * n[i][1] + n[i][2] * n[i][2];
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < i; ++j) {
      const T product = n[i][0] * n[j][0] + n[i][1] * n[j][1] + n[i][2] * n[j][2], lengths = squared[i] * squared[j];
      T root;
      for (int k = 0; k < kLanes; ++k) root[k] = std::sqrt(lengths[k]);
      const T c = -product / root;
      of_smallest = lengths > 0 ? (of_smallest < c ? c : of_smallest) : T{} + 1;
      of_largest = lengths > 0 ? (c < of_largest ? c : of_largest) : T{} - 1;
    }
  std::memcpy(cosines.data(), &of_smallest, sizeof of_smallest);
  std::memcpy(cosines.data() + 1, &of_largest, sizeof of_largest);
}
TREEMARCH_VECTOR_CLONES
void tetrahedra_cosines(const TetrahedronGroup& group, GroupCosines& cosines) { find_cosines<Lanes>(group, cosines); }

CosineRange pentatope_cosines(const std::array<Vec<4>, 5>& p) {
  const std::array<Vec<4>, 5> n = inward_normals<4>(p);
  CosineRange range;
  for (int i = 0; i <= 4; ++i)
    for (int j = 0; j < i; ++j) range.add(-dot(n[i], n[j]), squared_norm(n[i]) * squared_norm(n[j]));
  return range;
}

template <int Dim>
CosineRange cell_cosines(const std::array<Vec<Dim>, 8>& p, CellType type) {
  if constexpr (Dim == 3)
    if (type == CellType::tetrahedron) return tetrahedron_cosines({p[0], p[1], p[2], p[3]});
  if constexpr (Dim == 4) return pentatope_cosines({p[0], p[1], p[2], p[3], p[4]});
  CosineRange range;
  if (type == CellType::triangle) {
    if constexpr (Dim == 2)
      for (int i = 0; i < 3; ++i) add_angle(p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i], range);
    return range;
  }
  const CellTopology& shape = topology(type);
  for (int c = 0; c < shape.corner_count; ++c) {
    const auto& corner = shape.corners[c];
    auto edge = [&](int i) { return p[corner[i]] - p[corner[0]]; };
    if constexpr (Dim == 2)
      add_angle(edge(1), edge(2), range);
    else if constexpr (Dim == 3)
      add_corner(edge(1), edge(2), edge(3), range);
  }
  return range;
}

template <int Dim>
Vec<Dim> turned(const Frame<Dim>& frame, const Vec<Dim>& x) {
  Vec<Dim> w{};
  for (int c = 0; c < Dim; ++c) w = w + x[c] * frame.direction[c];
  return w;
}

/// Whether the axes of a frame are those of the world in some order and direction, so that it keeps shapes.
template <int Dim>
bool is_along_axes(const Frame<Dim>& frame) {
  return std::ranges::all_of(frame.direction, [](const Vec<Dim>& axis) {
    return std::ranges::count_if(axis, [](double x) { return std::abs(x) == 1; }) == 1 &&
           std::ranges::count(axis, 0.0) == Dim - 1;
  });
}

int bin(double degrees) { return std::clamp(static_cast<int>(degrees), 0, 179); }

/// The bins of most angles by their cosines, which costs less than to find the angle.
class CosineBins {
 public:
  static constexpr int kNone = -1;
  CosineBins() {
    // Far more than the rounding errors of cosines and angles come to.
    constexpr double kRounding = 1e-9;
    const auto bin_at = [](double cosine) { return bin(to_degrees(std::clamp(cosine, -1.0, 1.0))); };
    for (int i = 0; i < kSize; ++i) {
      const double low = (i - kHalf) / kHalf, high = (i + 1 - kHalf) / kHalf;
      const int first = bin_at(low - kRounding);
      bins_[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(first == bin_at(high + kRounding) ? first : kNone);
    }
  }
  /// kNone near a limit between bins.
  [[nodiscard]] int operator[](double cosine) const {
    if (!(cosine > -1 && cosine < 1)) return kNone;
    return bins_[static_cast<std::size_t>(std::min(kSize - 1, static_cast<int>((cosine + 1) * kHalf)))];
  }

 private:
  static constexpr int kSize = 8192;
  static constexpr double kHalf = kSize / 2.0;
  std::array<std::int16_t, kSize> bins_{};
};

bool is_worse(const WorstCell& a, const WorstCell& b) {
  if (a.angles.min != b.angles.min) return a.angles.min < b.angles.min;
  if (a.type != b.type) return a.type < b.type;
  return a.cell < b.cell;
}

void keep_worst(std::vector<WorstCell>& cells, std::size_t count) {
  std::sort(cells.begin(), cells.end(), is_worse);
  if (cells.size() > count) cells.resize(count);
}

/// Adds a cell to the worst `count`, which are among the given ones; looks at few of them.
void add_to_worst(const WorstCell& cell, std::size_t count, std::vector<WorstCell>& cells) {
  // In front are `count` sorted ones, if there are so many.
  if (count == 0 || (cells.size() >= count && !is_worse(cell, cells[count - 1]))) return;
  cells.push_back(cell);
  if (cells.size() == count || cells.size() >= 2 * count + 64) keep_worst(cells, count);
}

void add(JacobianQuality& a, const JacobianQuality& b) {
  a.cells += b.cells;
  a.min_scaled = std::min(a.min_scaled, b.min_scaled);
  a.min_ratio = std::min(a.min_ratio, b.min_ratio);
  a.mean_scaled += b.mean_scaled;  // sums, until the end
  a.mean_ratio += b.mean_ratio;
}

MeshQuality joined(MeshQuality a, const MeshQuality& b, std::size_t worst_count) {
  a.angles.add(b.angles);
  for (int i = 0; i < 180; ++i) {
    a.smallest[i] += b.smallest[i];
    a.largest[i] += b.largest[i];
  }
  a.mean_smallest += b.mean_smallest;  // sums, until the end
  for (std::size_t t = 0; t < a.jacobians.size(); ++t) add(a.jacobians[t], b.jacobians[t]);
  a.worst.insert(a.worst.end(), b.worst.begin(), b.worst.end());
  keep_worst(a.worst, worst_count);
  return a;
}

template <int Dim>
MeshQuality measure_block(const Mesh<Dim>& mesh, const CellBlock& block, const Frame<Dim>& frame,
                          std::size_t worst_count, const Execution& execution) {
  const int corners = vertex_count(block.type);
  const bool turn = !is_along_axes(frame);
  const auto corner = [&](std::int64_t c, int i) {
    const Vec<Dim>& x = mesh.points[block.cell(c)[i]];
    return turn ? turned(frame, x) : x;
  };
  const auto count = [](double smallest, int bin_of_largest, MeshQuality& q) {
    ++q.smallest[bin(smallest)];
    ++q.largest[bin_of_largest];
    q.mean_smallest += smallest;
  };
  const auto add_angles = [&](std::int64_t c, const DegreeRange& angles, MeshQuality& q) {
    q.angles.add(angles);
    count(angles.min, bin(angles.max), q);
    add_to_worst({block.type, c, angles, {}, 0}, worst_count, q.worst);
  };
  const auto measure_tetrahedra = [&](std::int64_t begin, std::int64_t end, MeshQuality& q) {
    static const CosineBins bins;
    TetrahedronGroup group;
    GroupCosines cosines;
    double extreme = 1;  // cosine of the largest angle so far
    for (std::int64_t first = begin; first < end; first += kLanes) {
      for (int k = 0; k < kLanes; ++k)
        for (int i = 0; i < 4; ++i) {
          const Vec<Dim> x = corner(std::min(first + k, end - 1), i);
          for (int d = 0; d < 3; ++d) group[i][d][k] = x[d];
        }
      tetrahedra_cosines(group, cosines);
      for (int k = 0; k < std::min<std::int64_t>(kLanes, end - first); ++k) {
        const CosineRange range{cosines[0][k], cosines[1][k]};
        const double smallest = to_degrees(std::min(1.0, range.of_smallest));
        // Of the largest angles, only the bin matters unless it is the largest so far or the cell is among the worst.
        const bool may_be_worst =
            worst_count > 0 && (q.worst.size() < worst_count || smallest <= q.worst[worst_count - 1].angles.min);
        const int bin_of_largest =
            may_be_worst || range.of_largest <= extreme ? CosineBins::kNone : bins[range.of_largest];
        if (bin_of_largest == CosineBins::kNone) {
          extreme = std::min(extreme, range.of_largest);
          add_angles(first + k, {smallest, to_degrees(std::max(-1.0, range.of_largest))}, q);
        } else {
          q.angles.min = std::min(q.angles.min, smallest);
          count(smallest, bin_of_largest, q);
        }
      }
    }
  };
  const auto measure_any = [&](std::int64_t begin, std::int64_t end, MeshQuality& q) {
    for (std::int64_t c = begin; c < end; ++c) {
      std::array<Vec<Dim>, 8> p{};
      for (int i = 0; i < corners; ++i) p[i] = corner(c, i);
      add_angles(c, cell_cosines<Dim>(p, block.type).degrees(), q);
      if (topology(block.type).corner_count > 1) {
        const CornerJacobians j = corner_jacobians<Dim>(p, block.type);
        add(q.jacobians[static_cast<std::size_t>(block.type)], {1, j.min_scaled, j.min_scaled, j.ratio(), j.ratio()});
      }
    }
  };
  auto measure_range = [&](std::int64_t begin, std::int64_t end) {
    MeshQuality q;
    if (Dim == 3 && block.type == CellType::tetrahedron)
      measure_tetrahedra(begin, end, q);
    else
      measure_any(begin, end, q);
    keep_worst(q.worst, worst_count);
    return q;
  };
  return parallel_reduce(execution, block.size(), kBlock, MeshQuality{}, measure_range,
                         [&](MeshQuality a, const MeshQuality& b) { return joined(std::move(a), b, worst_count); });
}

}  // namespace

DegreeRange dihedral_angles(const std::array<Vec<3>, 4>& tetrahedron) {
  return tetrahedron_cosines(tetrahedron).degrees();
}

DegreeRange triangle_angles(const std::array<Vec<2>, 3>& triangle) {
  return cell_cosines<2>({triangle[0], triangle[1], triangle[2]}, CellType::triangle).degrees();
}

template <int Dim>
DegreeRange cell_angles(const Vec<Dim>* points, CellType type, const VertexId* v) {
  std::array<Vec<Dim>, 8> p{};
  for (int i = 0; i < vertex_count(type); ++i) p[i] = points[v[i]];
  return cell_cosines<Dim>(p, type).degrees();
}

template <int Dim>
MeshQuality measure_quality(const Mesh<Dim>& mesh, const Frame<Dim>& frame, int worst_count,
                            const Execution& execution) {
  MeshQuality quality;
  const auto count = static_cast<std::size_t>(std::max(0, worst_count));
  for (const CellBlock& block : mesh.blocks)
    quality = joined(std::move(quality), measure_block(mesh, block, frame, count, execution), count);
  if (mesh.cell_count()) quality.mean_smallest /= static_cast<double>(mesh.cell_count());
  for (JacobianQuality& j : quality.jacobians) {
    if (j.cells == 0) continue;
    j.mean_scaled /= static_cast<double>(j.cells);
    j.mean_ratio /= static_cast<double>(j.cells);
  }
  for (WorstCell& w : quality.worst) {
    const CellBlock& block =
        *std::find_if(mesh.blocks.begin(), mesh.blocks.end(), [&](const CellBlock& b) { return b.type == w.type; });
    const int corners = vertex_count(w.type);
    Vec<Dim> centre{};
    for (int i = 0; i < corners; ++i) centre = centre + (1.0 / corners) * mesh.points[block.cell(w.cell)[i]];
    centre = to_world(frame, centre);
    std::copy_n(centre.begin(), std::min(Dim, 3), w.centre.begin());
    w.label = mesh.labels[block.materials[w.cell]];
  }
  return quality;
}

template DegreeRange cell_angles(const Vec<2>*, CellType, const VertexId*);
template DegreeRange cell_angles(const Vec<3>*, CellType, const VertexId*);
template MeshQuality measure_quality(const Mesh<2>&, const Frame<2>&, int, const Execution&);
template MeshQuality measure_quality(const Mesh<3>&, const Frame<3>&, int, const Execution&);
template MeshQuality measure_quality(const Mesh<4>&, const Frame<4>&, int, const Execution&);

}  // namespace treemarch
