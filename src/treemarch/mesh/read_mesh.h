/// \file
/// Meshes from files, to examine them.
#pragma once

#include <string>
#include <variant>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"

namespace treemarch {

using AnyMesh = std::variant<Mesh<2>, Mesh<3>>;

/// Reads a mesh by its extension: .vtu (any encoding, zlib or none, little endian), .msh (Gmsh 4.1, text or binary) or
/// .mesh (Medit, text). Points are in the coordinates of the file. Of cells of several dimensions the highest counts; a
/// mesh of faces is 2D if z is 0 everywhere. Labels come from the cell array `label` (.vtu, .msh), else the physical
/// group
/// (.msh), or the reference (.mesh); materials are numbered by their first appearance.
/// \throw Error(input) in one line for whatever the file may hold; Error(usage) for an unknown extension.
AnyMesh read_mesh(const std::string& path, const Execution& execution);

}  // namespace treemarch
