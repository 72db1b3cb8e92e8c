/// \file
/// Cells and volumes by material.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

/// Some cells of one block.
template <int Dim>
struct CellRange {
  const CellBlock* block;
  std::int64_t begin, end;
};

/// The cells of a mesh in ranges that suit one task each, whatever the number of threads.
template <int Dim>
std::vector<CellRange<Dim>> cell_ranges(const Mesh<Dim>& mesh);

/// By material of a mesh.
struct CellSums {
  std::vector<std::int64_t> cells;
  std::vector<double> volume;  ///< physical; 2D: area
};

/// The same for any number of threads.
template <int Dim>
CellSums sum_cells(const Mesh<Dim>& mesh, const Execution& execution);

}  // namespace treemarch
