/// \file
/// The lattice of the default method: cubic cells in physical space, whatever the voxels are like.
#pragma once

#include "treemarch/image/label_image.h"
#include "treemarch/sizing/lattice.h"

namespace treemarch {

/// Largest ratio of the sides of a cell for which the default method's bound of 18 degrees holds (enumerated: 18.10
/// at 1.02).
inline constexpr double kMostStretch = 1.02;

/// Lays out cells that are as good as cubic and fill the box exactly: along each axis the number of cells is rounded,
/// and of the sizes from `smallest` down to four fifths of it the largest is taken that keeps the ratio of the sides
/// within kMostStretch, else that with the least ratio. Isotropic voxels and a whole multiple of their side that
/// divides the image give whole voxels. \param smallest side of the smallest cell. \param largest no cell is larger; at
/// least one level. \pre 0 < smallest <= largest
template <int Dim>
SizedLattice<Dim> choose_cubic_lattice(const LabelImage<Dim>& image, double smallest, double largest);

/// Ratio of the longest to the shortest side of a cell.
template <int Dim>
double stretch(const Lattice<Dim>& lattice);

}  // namespace treemarch
