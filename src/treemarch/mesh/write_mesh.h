/// \file
/// Meshes and their interfaces as files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/frame.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/mesh_extras.h"
#include "treemarch/mesh/output_frame.h"

namespace treemarch {

struct WriteOptions {
  bool overwrite = false;  ///< else an existing file is an error
  bool compress = true;    ///< .vtu and .xdmf only
  OutputSpace space = OutputSpace::file;
};

/// Whether `path` can become a mesh file; to be asked before the work of making the mesh. Leaves nothing behind.
/// \throw Error(usage) for an unknown extension, Error(output) for a place that cannot be written.
void check_mesh_path(const std::string& path, bool overwrite);
/// The same for a file of facets, in the formats of write_interfaces(). \param dim dimension of the mesh, 0 where it is
/// not known yet.
void check_surface_path(const std::string& path, bool overwrite, int dim = 0);

/// Writes a mesh in the format of the extension: .vtu (VTK), .msh (Gmsh 4.1, binary), .mesh (Medit, text) or .xdmf
/// (XDMF 3 with its arrays in an .h5 beside it; cells of one type; the only one for four dimensions). Files are whole
/// or absent, and the same for any number of threads.
///
/// Points are in the world of `frame` (or another OutputSpace), in double precision. Where that is left-handed, two
/// vertices of each cell are swapped, so that cells stay positive. Each cell carries the image's own label: cell array
/// `label` (.vtu), physical group (.msh; with a label below 1 there is an element array `label` as well, since Gmsh
/// wants positive groups), reference (.mesh). The file records the frame; docs/stages/mesh.md says how.
/// \param extras a partition becomes the arrays `partition` of cells and of points, a node set an array of points under
/// its name, 1 within and 0 elsewhere; not in .mesh.
/// \throw Error(output), Error(usage)
template <int Dim>
void write_mesh(const std::string& path, const Mesh<Dim>& mesh, const Frame<Dim>& frame, const WriteOptions& options,
                const Execution& execution, const MeshExtras& extras = {});

/// Writes facets (mesh/interfaces.h) of a mesh with the points that they use, in the formats of write_mesh() or as
/// .vtp, .stl or .ply. Each has its two labels: cell arrays `label_first` and `label_second` (.vtu, .vtp, .msh, .xdmf,
/// .ply), a solid FIRST_SECOND a pair (.stl), or a reference that a comment explains (.mesh). The outside is
/// outside_label(), which the file records.
template <int Dim>
void write_interfaces(const std::string& path, const Mesh<Dim>& mesh, const std::vector<FacetBlock>& facets,
                      const Frame<Dim>& frame, const WriteOptions& options, const Execution& execution);

/// The value that stands for the outside where labels are written: the largest negative one that is no label.
std::int32_t outside_label(const std::vector<std::int32_t>& labels);

}  // namespace treemarch
