/// \file
/// Sets of vertices as users write them.
#pragma once

#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/frame.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/mesh_extras.h"

namespace treemarch {

/// The vertices that each text names, NAME=WHAT:
///   box:X0,Y0,Z0,X1,Y1,Z1    within a box, sides included (2D: four numbers, 4D: eight)
///   plane:A,B,C,D            where A x + B y + C z = D
///   plane:A,B,C,D,W          no farther than W from there
///   nodes:0,17,20-25         by number, as in the file, from 0
/// Coordinates are those of the file that is written; borders count with a millionth of the mesh's size.
/// \param frame of the coordinates, as output_frame() gives it.
/// \throw Error(usage) for a text that is none of these, a name twice, a number beyond the mesh or an empty set.
template <int Dim>
std::vector<NodeSet> find_node_sets(const std::vector<std::string>& texts, const Mesh<Dim>& mesh,
                                    const Frame<Dim>& frame, const Execution& execution);

/// The form of the texts alone, to be checked before a mesh is made. \throw Error(usage)
void check_node_sets(const std::vector<std::string>& texts, int dimension);

}  // namespace treemarch
