/// \file
/// What the writers of all formats are given: cells of one dimension in groups that share their labels. A volume mesh
/// has a group for each material, an interface mesh one for each pair.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/output_file.h"

namespace treemarch {

struct MeshSource {
  struct Group {
    std::vector<std::int32_t> values;  ///< one for each of array_names
    std::string name;
  };
  struct Block {
    CellType type{};
    std::int64_t size = 0;
    const VertexId* vertices = nullptr;
    const std::uint32_t* groups = nullptr;  ///< one a cell
  };

  int cell_dimension = 3;
  int coordinates = 3;  ///< of a point: 4 in space-time, else 3
  std::int64_t point_count = 0;
  /// Writes the coordinates of points [begin, end).
  std::function<void(std::int64_t begin, std::int64_t end, double* to)> points;
  std::vector<Block> blocks;
  bool mirrored = false;  ///< cells are to be written in mirrored_order()
  std::vector<std::string> array_names;
  std::vector<Group> groups;

  /// Further whole numbers, one a cell (through the blocks) or a point.
  struct Array {
    std::string name;
    const std::int32_t* values = nullptr;
  };
  std::vector<Array> cell_arrays, point_arrays;

  // The record of the frame.
  std::string space;                 ///< letters of the axes, "index", or empty
  std::vector<double> affine;        ///< voxel index (centres at integers) to coordinates, row by row
  std::int32_t outside = 0;          ///< label of the outside
  std::vector<std::int32_t> labels;  ///< labels that have names
  std::vector<std::string> names;

  /// Corners of all cells: the length of their connectivity.
  [[nodiscard]] std::int64_t corner_count() const {
    std::int64_t n = 0;
    for (const Block& b : blocks) n += b.size * vertex_count(b.type);
    return n;
  }
  /// Whether 32 bits with sign hold all numbers of points, and all positions in the connectivity.
  [[nodiscard]] bool fits_32_bits() const { return std::max(corner_count(), point_count) <= 0x7fffffff; }
  [[nodiscard]] int affine_side() const { return coordinates + 1; }
  [[nodiscard]] std::int64_t cell_count() const {
    std::int64_t n = 0;
    for (const Block& b : blocks) n += b.size;
    return n;
  }
};

/// Makes chunks of [0, n) in parallel and writes them in order; a few are in memory at a time.
/// \param make appends the bytes of [begin, end) to `out`, which comes empty. \return the size of each chunk in bytes.
std::vector<std::uint64_t> write_chunks(OutputFile& file, const Execution& execution, std::int64_t n,
                                        std::int64_t chunk,
                                        const std::function<void(std::int64_t, std::int64_t, std::string&)>& make);

void write_vtu(const MeshSource& mesh, bool compress, OutputFile& file, const Execution& execution);
/// The same with lines, triangles and quads as VTK's polygonal data.
void write_vtp(const MeshSource& mesh, bool compress, OutputFile& file, const Execution& execution);
/// Triangles in the order of the groups, one solid each. Quads are cut.
void write_stl(const MeshSource& mesh, OutputFile& file, const Execution& execution);
void write_ply(const MeshSource& mesh, OutputFile& file, const Execution& execution);
void write_msh(const MeshSource& mesh, OutputFile& file, const Execution& execution);
void write_medit(const MeshSource& mesh, OutputFile& file, const Execution& execution);

/// The two files of XDMF: the text, and the arrays that it describes. \pre mesh.blocks.size() == 1
/// \param path name of the arrays' file for messages. \param file where they are written for the time being.
void write_xdmf_arrays(const MeshSource& mesh, bool compress, const std::string& path, const std::string& file,
                       const Execution& execution);
/// \param arrays name of the file of the arrays, as the text shall refer to it.
std::string xdmf_text(const MeshSource& mesh, const std::string& arrays);
/// The name of the arrays' file that goes with an .xdmf.
std::string xdmf_arrays_path(const std::string& path);

/// Appends the bytes of a number.
template <class T>
void append_bytes(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Appends the shortest text that reads back as the same number.
void append_number(std::string& text, double value);
void append_number(std::string& text, std::int64_t value);

/// The record of the frame as lines of text, for formats that have comments only; each starts with `prefix`.
std::string describe_frame(const MeshSource& mesh, const std::string& prefix);

}  // namespace treemarch
