/// \file
/// Parts a material from itself, or joins it, where it touches itself at a vertex or an edge only.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "treemarch/image/label_image.h"
#include "treemarch/improve/patch.h"
#include "treemarch/topology/vertex_link.h"

namespace treemarch {

/// Area (2D: length) of the facet opposite to a corner of a cell.
template <int Dim>
double facet_area(const Patch<Dim>& patch, CellId c, int corner);

/// Whether the cells of one material beside the given ones, which have it too, hang together without them, close by:
/// over facets, among the cells around their vertices. \pre !cells.empty(); their vertices have stars
template <int Dim>
bool keeps_connection(const Patch<Dim>& patch, std::span<const CellId> cells);

/// Relabels pieces of the stars of pinched vertices, as long as that makes the boundaries of the materials manifolds at
/// more vertices and disconnects nothing. Serial: few vertices need it.
template <int Dim>
class Unpincher {
 public:
  Unpincher(Patch<Dim>& patch, const Mesh<Dim>& mesh, const LabelImage<Dim>& image)
      : patch_(patch), mesh_(mesh), image_(image) {}

  /// Treats the vertices in their order, and those that are pinched by a move, again and again while that helps.
  void run(std::vector<VertexId> vertices);
  [[nodiscard]] std::int64_t relabelled() const { return relabelled_; }
  /// Sheets that are left.
  [[nodiscard]] std::int64_t left() const { return left_; }
  /// Whether there might be a move for some of them if more vertices had stars.
  [[nodiscard]] bool is_confined() const { return confined_; }
  /// Sheets of boundaries at a vertex beyond one a material.
  int excess(VertexId v);

 private:
  /// Cells around a vertex that change from one material to another.
  struct Move {
    std::vector<CellId> cells;
    MaterialId to = 0;
    int gain = 0;                // sheets fewer
    std::int64_t agreement = 0;  // cells for which the image is for it, less those for which it is against it
    double volume = 0;
    double contact = 0;  // area of the facets to the material they go to
  };

  bool treat(VertexId v);
  void list_parts(VertexId v);
  void propose_parts();
  void propose_along_edges(VertexId v);
  void propose_cells();
  [[nodiscard]] int excess_before(VertexId v);
  void propose(std::span<const CellId> cells, MaterialId to);
  bool apply_best();
  [[nodiscard]] MaterialId image_material(CellId c) const;
  void relabel(std::span<const CellId> cells, MaterialId to) {
    for (const CellId c : cells) patch_.relabel(c, to);
  }
  Patch<Dim>& patch_;
  const Mesh<Dim>& mesh_;
  const LabelImage<Dim>& image_;
  VertexLink<Dim> link_;
  std::vector<CellId> star_;
  std::vector<std::array<int, Dim>> beside_;  // the cells of the star beside each of them at the facets at v, or -1
  std::vector<int> part_;  // of each cell of the star: cells of one material that hang together over facets at v
  int parts_ = 0;
  std::vector<Move> moves_;
  std::vector<std::pair<VertexId, int>> before_;
  std::vector<VertexId> touched_;
  std::vector<VertexId> pinched_;  // by moves
  std::int64_t relabelled_ = 0, left_ = 0;
  bool at_rim_ = false;  // a move of the vertex that is treated was not tried, as a vertex of it has no star
  bool confined_ = false;
};

}  // namespace treemarch
