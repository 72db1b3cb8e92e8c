/// \file
/// One separation of one material from the rest: the two-material marching simplices of the paper.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/march/paper_cells.h"
#include "treemarch/march/paper_march.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Separates materials on the active cells of a mesh. One object serves all separations of a mesh, so that the arrays
/// per vertex are made once; each call costs in proportion to the cells at the material's interface.
template <int Dim>
class PaperSeparation {
 public:
  using Index = typename ActiveCells<Dim>::Index;
  using Cell = typename ActiveCells<Dim>::Cell;

  /// \param materials number of materials
  /// \pre `points` belongs to the mesh of `cells`; both outlive this object
  PaperSeparation(ActiveCells<Dim>& cells, Points<Dim>& points, std::size_t materials,
                  const PaperMarchOptions<Dim>& options, Execution& execution);

  /// Separates one material. Adds to the counts of `report`.
  /// \param candidates vertices, sorted: at least all that touch both the material and another
  /// \return the cells that are new or have a new material, ascending
  std::vector<Index> separate(MaterialId material, std::span<const VertexId> candidates, PaperMarchReport& report);

 private:
  using Signs = std::array<std::int8_t, Dim + 1>;
  /// A vertex of the cell's edge to another sign, and where the surface crosses: the fraction from the first.
  struct Crossing {
    double t;
    VertexId vertex, other;
  };
  /// A cell, or the pieces of one, that the material lost.
  struct LostPart {
    std::uint32_t first, count;  ///< range in lost_cells_
  };

  void find_vertices(std::span<const VertexId> candidates);
  void find_region();
  void evaluate();
  void evaluate_solid_angles(std::size_t i);
  void evaluate_field(std::span<const VertexId> vertices);
  [[nodiscard]] std::vector<VertexId> one_sided_vertices() const;
  [[nodiscard]] bool on_earlier_surface(VertexId v) const;
  [[nodiscard]] std::int8_t sign(Index c, int corner) const;
  [[nodiscard]] double offset(Index c, int corner) const;
  [[nodiscard]] Signs signs(Index c) const;
  [[nodiscard]] static bool is_cut(const Signs& s);

  std::int64_t snap();
  [[nodiscard]] Crossing nearest_crossing(VertexId v) const;
  [[nodiscard]] bool move(VertexId v, const Vec<Dim>& to);
  [[nodiscard]] unsigned stratum(VertexId v) const;

  [[nodiscard]] Vec<Dim> cut_point(Index c, int a, int b) const;
  [[nodiscard]] VertexId flat_vertex(Index c) const;
  std::int64_t keep_flat();

  void number_cuts();
  [[nodiscard]] VertexId cut_vertex(VertexId a, VertexId b) const;
  void apply(PaperMarchReport& report);
  void split_cell(Index c);
  void assign_lost(PaperMarchReport& report);
  [[nodiscard]] MaterialId majority(const LostPart& part) const;

  ActiveCells<Dim>& cells_;
  Points<Dim>& points_;
  const PaperMarchOptions<Dim>& options_;
  Execution& execution_;
  Vec<Dim> low_, high_;  ///< bounding box

  MaterialId material_ = kOutside;
  std::vector<std::uint8_t> separated_;  ///< per material: whether its turn is over
  std::vector<VertexId> vertices_;       ///< that touch both sides, ascending
  std::vector<Index> region_;            ///< cells of vertices_, ascending
  std::vector<std::int8_t> sign_;        ///< per vertex of the mesh: of f - 1/2, or kOneSided
  std::vector<double> offset_;           ///< per vertex of the mesh: f - 1/2 where sign_ is known
  std::vector<std::uint8_t> in_region_;  ///< per active cell, 0 between calls
  std::vector<Index> cut_cells_;         ///< cells with both signs, ascending
  std::vector<std::uint64_t> cut_keys_;  ///< both vertices of each cut edge, the smaller first, ascending
  VertexId first_cut_ = 0;               ///< vertex of cut_keys_[0]
  std::vector<Index> changed_, lost_cells_;
  std::vector<LostPart> lost_;
};

}  // namespace treemarch
