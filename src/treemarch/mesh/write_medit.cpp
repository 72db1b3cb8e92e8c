// Medit's text format; the reference of a cell is its label.
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh_source.h"

namespace treemarch {
namespace {

constexpr std::int64_t kChunk = 1 << 15;

constexpr const char* keyword(CellType type) {
  constexpr const char* kKeywords[] = {"Edges", "Triangles", "Quadrilaterals", "Tetrahedra", "Pyramids", "Hexahedra"};
  return kKeywords[static_cast<int>(type)];
}

}  // namespace

void write_medit(const MeshSource& mesh, OutputFile& file, const Execution& execution) {
  const bool are_labels = mesh.array_names.size() == 1;
  std::string head = "MeshVersionFormatted 2\n" + describe_frame(mesh, "# ");
  for (std::size_t g = 0; g < mesh.groups.size() && !are_labels; ++g) {
    head.append("# reference ").append(std::to_string(g + 1)).append(":");
    for (const std::int32_t v : mesh.groups[g].values) head.append(" ").append(std::to_string(v));
    head += '\n';
  }
  // Three coordinates always: Gmsh reads no others.
  file.write(head + "Dimension 3\nVertices\n" + std::to_string(mesh.point_count) + "\n");
  write_chunks(file, execution, mesh.point_count, kChunk, [&](std::int64_t begin, std::int64_t end, std::string& to) {
    std::vector<double> xyz(static_cast<std::size_t>(3 * (end - begin)));
    mesh.points(begin, end, xyz.data());
    for (std::size_t i = 0; i < xyz.size(); i += 3) {
      for (int d = 0; d < 3; ++d) {
        append_number(to, xyz[i + d]);
        to += ' ';
      }
      to += "0\n";
    }
  });
  for (const MeshSource::Block& block : mesh.blocks) {
    file.write(std::string(keyword(block.type)) + "\n" + std::to_string(block.size) + "\n");
    const int corners = vertex_count(block.type);
    const auto& mirrored = mirrored_order(block.type);
    write_chunks(file, execution, block.size, kChunk, [&](std::int64_t begin, std::int64_t end, std::string& to) {
      for (std::int64_t c = begin; c < end; ++c) {
        const VertexId* v = block.vertices + c * corners;
        for (int k = 0; k < corners; ++k) {
          append_number(to, std::int64_t{v[mesh.mirrored ? mirrored[k] : k]} + 1);
          to += ' ';
        }
        const std::uint32_t group = block.groups[c];
        append_number(to, are_labels ? std::int64_t{mesh.groups[group].values[0]} : std::int64_t{group} + 1);
        to += '\n';
      }
    });
  }
  file.write("End\n");
}

}  // namespace treemarch
