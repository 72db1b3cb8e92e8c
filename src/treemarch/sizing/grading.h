/// \file
/// How fast cells may grow away from small ones.
#pragma once

#include <cstdint>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/sizing/lattice.h"

namespace treemarch {

/// Raises levels such that cells of a level are followed by at least 1 / grading cells of it (rounded up) before larger
/// ones may come: sizes grow by at most `grading` a unit of length. 1 changes nothing, since a balanced tree does that.
/// \param levels as from required_levels(); one a finest cell. \pre 0 < grading <= 1
template <int Dim>
void limit_growth(const SizedLattice<Dim>& sized, double grading, std::vector<std::uint8_t>& levels,
                  const Execution& execution);

}  // namespace treemarch
