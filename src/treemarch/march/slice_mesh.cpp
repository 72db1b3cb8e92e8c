#include "treemarch/march/slice_mesh.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/march/paper_split.h"

namespace treemarch {
namespace {

constexpr std::int64_t kCellsPerBlock = 1 << 14;
constexpr double kInPlane = 1e-7;  // of the extent along the last axis

/// Both ends of an edge, the smaller first; a vertex of the mesh twice.
using Key = std::uint64_t;

constexpr Key key_of(VertexId a, VertexId b) { return Key{a} << 32U | b; }

template <int Dim>
class Slicer {
 public:
  Slicer(const Mesh<Dim>& mesh, double position, const Execution& execution)
      : mesh_(mesh), position_(position), execution_(execution), sign_(mesh.points.size()) {
    double low = mesh.points[0][Dim - 1];
    double high = low;
    for (const Vec<Dim>& p : mesh.points) {
      low = std::min(low, p[Dim - 1]);
      high = std::max(high, p[Dim - 1]);
    }
    const double tolerance = kInPlane * (high - low);
    from_above_ = position <= low + tolerance;
    parallel_for(execution, std::ssize(mesh.points), kCellsPerBlock, [&](std::int64_t v) {
      const double offset = mesh.points[static_cast<std::size_t>(v)][Dim - 1] - position;
      sign_[static_cast<std::size_t>(v)] = static_cast<std::int8_t>((offset > tolerance) - (offset < -tolerance));
    });
  }

  Mesh<Dim - 1> run(const CellBlock& cells) {
    const std::int64_t blocks = block_count(cells.size(), kCellsPerBlock);
    std::vector<std::vector<std::pair<std::array<Key, Dim>, MaterialId>>> parts(static_cast<std::size_t>(blocks));
    parallel_for(execution_, blocks, 1, [&](std::int64_t b) {
      for (std::int64_t c = b * kCellsPerBlock; c < std::min(cells.size(), (b + 1) * kCellsPerBlock); ++c)
        slice_cell(cells.cell(c), cells.materials[static_cast<std::size_t>(c)], parts[static_cast<std::size_t>(b)]);
    });
    std::vector<Key> keys;
    for (const auto& part : parts)
      for (const auto& piece : part) keys.insert(keys.end(), piece.first.begin(), piece.first.end());
    // Vertices of the mesh before cuts; equal keys are indistinguishable.
    const auto order = [](Key a, Key b) { return std::pair(is_cut(a), a) < std::pair(is_cut(b), b); };
    parallel_sort(execution_, keys, order);
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());

    Mesh<Dim - 1> result;
    result.labels = mesh_.labels;
    result.names = mesh_.names;
    for (const Key key : keys) result.points.push_back(point_of(key));
    CellBlock block{kSimplex<Dim - 1>, {}, {}};
    for (const auto& part : parts) {
      for (const auto& [corners, material] : part) {
        for (const Key key : corners)
          block.vertices.push_back(static_cast<VertexId>(std::ranges::lower_bound(keys, key, order) - keys.begin()));
        block.materials.push_back(material);
      }
    }
    if (block.size() > 0) result.blocks.push_back(std::move(block));
    return result;
  }

 private:
  static bool is_cut(Key key) { return key >> 32U != (key & 0xffffffffU); }

  void slice_cell(const VertexId* cell, MaterialId material,
                  std::vector<std::pair<std::array<Key, Dim>, MaterialId>>& out) const {
    std::array<int, Dim + 1> order{};
    bool odd = false;
    for (int i = 0; i <= Dim; ++i) {
      order[i] = i;
      for (int j = i; j > 0 && cell[order[j]] < cell[order[j - 1]]; --j) {
        std::swap(order[j], order[j - 1]);
        odd = !odd;
      }
    }
    std::array<std::int8_t, Dim + 1> signs{};
    for (int i = 0; i <= Dim; ++i) signs[i] = sign_[cell[order[i]]];
    const bool above = std::ranges::count(signs, 1) != 0;
    const bool below = std::ranges::count(signs, -1) != 0;
    if (!(above && below) && above != from_above_) return;
    constexpr auto kEnds = edge_ends<Dim>();
    for (const auto& piece : simplex_slice<Dim>(signs)) {
      std::array<Key, Dim> keys{};
      for (int k = 0; k < Dim; ++k) {
        const auto [a, b] = piece[k] <= Dim ? std::array{piece[k], piece[k]} : kEnds[piece[k] - Dim - 1];
        keys[k] = key_of(cell[order[a]], cell[order[b]]);
      }
      if (odd) std::swap(keys[0], keys[1]);
      out.emplace_back(keys, material);
    }
  }

  [[nodiscard]] Vec<Dim - 1> point_of(Key key) const {
    const Vec<Dim>& a = mesh_.points[key >> 32U];
    const Vec<Dim>& b = mesh_.points[key & 0xffffffffU];
    Vec<Dim - 1> x{};
    const double t = is_cut(key) ? (position_ - a[Dim - 1]) / (b[Dim - 1] - a[Dim - 1]) : 0;
    for (int d = 0; d < Dim - 1; ++d) x[d] = a[d] + t * (b[d] - a[d]);
    return x;
  }

  const Mesh<Dim>& mesh_;
  double position_;
  const Execution& execution_;
  bool from_above_ = false;
  std::vector<std::int8_t> sign_;  ///< per vertex: before the plane, in it, after it
};

}  // namespace

template <int Dim>
Mesh<Dim - 1> slice_mesh(const Mesh<Dim>& mesh, double position, const Execution& execution) {
  if (mesh.points.empty()) return {};
  if (mesh.blocks.size() != 1 || mesh.blocks[0].type != kSimplex<Dim>)
    throw Error(ErrorKind::input, "slice: the mesh has cells that are no simplices; give one of simplices alone");
  return Slicer<Dim>(mesh, position, execution).run(mesh.blocks[0]);
}

template Mesh<2> slice_mesh(const Mesh<3>&, double, const Execution&);
template Mesh<3> slice_mesh(const Mesh<4>&, double, const Execution&);

}  // namespace treemarch
