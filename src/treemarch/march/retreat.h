/// \file
/// Step D of the default cut: points of stencils that are too flat go back towards their undisplaced places.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/core/raw_vector.h"
#include "treemarch/march/band.h"
#include "treemarch/march/snap.h"
#include "treemarch/march/stencil.h"
#include "treemarch/tessellate/body_centred.h"

namespace treemarch {

/// How a simplex is split: the pattern of its cuts and diagonals, and which choice of that stencil.
struct SplitRecord {
  std::uint16_t pattern : 10;  ///< 0: whole
  std::uint16_t choice : 6;
};
static_assert(sizeof(SplitRecord) == 2);

/// The points of a snapped lattice and how far each has retreated: a lattice vertex towards its lattice place, a cut
/// towards the middle of its edge, a triple point towards the centroid of its triangle.
template <int Dim>
class CutGeometry {
 public:
  using T = StencilTopology<Dim>;
  using Simplex = std::array<VertexId, Dim + 1>;
  static constexpr int kLevels = 5;

  /// What a simplex needs to be split.
  struct Local {
    unsigned cuts = 0;  ///< bit e: edge e is cut
    std::array<EdgeId, T::kEdges> edge;
    std::array<std::int64_t, T::kFaces> triple;  ///< index of the triple point, -1 where a face has fewer cuts
    bool placed = false;
    std::array<Vec<Dim>, T::kPoints> point;  ///< once placed
  };

  /// \param points becomes where the vertices of the lattice are, kept up to date; others may be appended to it
  CutGeometry(const SimplexLattice<Dim>& lattice, const Band<Dim>& band, const SnappedLattice<Dim>& snapped,
              Points<Dim>& points, Execution& execution);

  /// Finds the cuts and the triple points of a simplex of the band. \param cuts which of its edges are cut
  void find_cuts(const Simplex& simplex, unsigned cuts, Local& local) const;
  /// Finds where all its points are. \pre find_cuts(), unless nothing is cut.
  void place(const Simplex& simplex, Local& local) const;

  [[nodiscard]] Vec<Dim> cut_point(EdgeId e) const;
  [[nodiscard]] Vec<Dim> triple_point(std::int64_t i) const;
  [[nodiscard]] std::int64_t triple_count() const { return static_cast<std::int64_t>(band_.triangles().size()); }

  /// Retreats until every stencil meets the floor. Levels only rise and the last level passes, so it ends.
  void retreat(double quality_floor, Execution& execution);
  /// How the simplices of a block of the band are split after retreat().
  [[nodiscard]] std::span<const SplitRecord> splits(std::int64_t block) const {
    return std::span(split_).subspan(band_.first(block), band_.simplices(block).size());
  }

  std::int64_t retreated = 0;  ///< points that are not where they were cut or snapped
  int rounds = 0;

 private:
  using Triangle = typename Band<Dim>::Triangle;
  /// See stencil_pattern().
  [[nodiscard]] unsigned pattern_of(const Simplex& simplex, const Local& local) const;
  /// The best way to split a simplex; the inner point is taken only where nothing else meets the floor.
  [[nodiscard]] StencilChoice choose(const Local& local, unsigned pattern, bool inner) const;
  /// Chooses how to split a simplex. \return whether the choice meets the floor.
  bool settle(const Simplex& simplex, unsigned cuts, bool inner, SplitRecord& split) const;
  /// Settles simplices of a block. \return those that fail, whose points are marked to rise
  std::vector<std::uint32_t> settle_block(std::int64_t block, std::span<const std::uint32_t> chosen, bool inner);
  void place_vertex(VertexId v);
  /// Raises the points of the simplices that failed, per block. \return all vertices of these, ascending
  std::vector<VertexId> raise(const std::vector<std::vector<std::uint32_t>>& failed, Execution& execution);
  /// Whether a block of leaves may have simplices at one of a few vertices; true if there are many.
  [[nodiscard]] bool may_touch(std::int64_t block, std::span<const VertexId> vertices) const;
  [[nodiscard]] std::int64_t find_triple(Triangle triangle) const;
  /// Calls f(level) for each point of a stencil that can retreat.
  template <class F>
  void for_levels(const Simplex& simplex, unsigned cuts, F&& f);

  const SimplexLattice<Dim>& lattice_;
  const Band<Dim>& band_;
  const SnappedLattice<Dim>& snapped_;
  Points<Dim>& points_;
  std::vector<std::uint8_t> vertex_level_, cut_level_, triple_level_;
  RawVector<SplitRecord> split_;  // of the simplices of the band, block after block
  QualityBound floor_{0}, enough_{30};
  SquaredQualityBound sure_{floor_};
};

}  // namespace treemarch
