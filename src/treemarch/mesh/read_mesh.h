/// \file
/// Meshes from files, to examine them.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

using AnyMesh = std::variant<Mesh<2>, Mesh<3>, Mesh<4>>;

/// What a file says about its coordinates.
struct MeshRecord {
  std::string space;           ///< letters of the axes, "index", or empty
  std::vector<double> affine;  ///< voxel index (centres at integers) to coordinates, row by row; empty if not known
};

/// Reads a mesh by its extension: .vtu (any encoding, zlib or none, little endian), .msh (Gmsh 4.1, text or binary),
/// .mesh (Medit, text) or .xdmf (as write_mesh() writes it, with its .h5). Points are in the coordinates of the file.
/// Of cells of several dimensions the highest counts; a mesh of faces is 2D if z is 0 everywhere. Labels come from the
/// cell array `label` (.vtu, .msh), else the physical group
/// (.msh), or the reference (.mesh); materials are numbered by their first appearance.
/// \param record filled from .xdmf; may be null.
/// \throw Error(input) in one line for whatever the file may hold; Error(usage) for an unknown extension.
AnyMesh read_mesh(const std::string& path, const Execution& execution, MeshRecord* record = nullptr);

}  // namespace treemarch
