#include <optional>

#include "treemarch/mesh/mesh_input.h"

namespace treemarch {
namespace {

std::optional<CellType> cell_type(std::string_view keyword) {
  constexpr std::pair<std::string_view, CellType> kTypes[] = {
      {"Edges", CellType::line},          {"Triangles", CellType::triangle},
      {"Quadrilaterals", CellType::quad}, {"Tetrahedra", CellType::tetrahedron},
      {"Pyramids", CellType::pyramid},    {"Hexahedra", CellType::hexahedron}};
  for (const auto& [name, type] : kTypes)
    if (keyword == name) return type;
  return {};
}

bool is_letter(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

void read_vertices(Cursor& in, int dim, MeshInput& mesh) {
  const std::size_t count = in.checked_count(in.number<std::int64_t>(), 2 * static_cast<std::size_t>(dim));
  mesh.points.assign(count, Vec<3>{});
  for (Vec<3>& p : mesh.points) {
    for (int d = 0; d < dim; ++d) p[d] = in.number<double>();
    in.number<std::int64_t>();  // the reference of a vertex means nothing here
  }
}

void read_cells(Cursor& in, CellType type, MeshInput& mesh) {
  const int corners = vertex_count(type);
  const std::size_t count = in.checked_count(in.number<std::int64_t>(), 2 * static_cast<std::size_t>(corners));
  MeshInput::Cells& cells = mesh.cells_of(type);
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < corners; ++k) cells.vertices.push_back(in.number<std::int64_t>() - 1);
    cells.labels.push_back(in.number<std::int32_t>());
  }
}

}  // namespace

MeshInput read_medit(std::string_view file) {
  Cursor in(file);
  if (in.word() != "MeshVersionFormatted") throw BadFile("is not a Medit file");
  in.number<int>();
  MeshInput mesh;
  int dim = 0;
  for (std::string_view keyword = in.word(); !keyword.empty() && keyword != "End"; keyword = in.word()) {
    if (keyword == "Dimension") {
      dim = in.number<int>();
      if (dim != 2 && dim != 3) throw BadFile("has a dimension other than 2 or 3");
    } else if (keyword == "Vertices") {
      if (dim == 0) throw BadFile("lists vertices before its dimension");
      read_vertices(in, dim, mesh);
    } else if (const std::optional<CellType> type = cell_type(keyword)) {
      read_cells(in, *type, mesh);
    } else if (!is_letter(keyword.front())) {
      throw BadFile("has \"" + std::string(keyword.substr(0, 20)) + "\" where a keyword should be");
    } else {
      for (in.skip_space(); !in.at_end() && !is_letter(in.peek()); in.skip_space()) in.word();
    }
  }
  return mesh;
}

}  // namespace treemarch
