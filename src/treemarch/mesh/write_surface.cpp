// Surfaces of triangles: STL (text, one solid a pair of labels) and PLY (binary, with both labels).
#include <array>

#include "treemarch/core/error.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh_source.h"

namespace treemarch {
namespace {

constexpr std::int64_t kChunk = 1 << 14;

/// The triangles of all facets; quads are cut along the diagonal of their smallest vertex, so that both sides of a
/// facet agree.
struct Triangles {
  std::vector<std::array<VertexId, 3>> vertices;
  std::vector<std::uint32_t> groups;
};

Triangles triangles_of(const MeshSource& mesh, const char* format) {
  Triangles result;
  for (const MeshSource::Block& block : mesh.blocks) {
    if (block.type != CellType::triangle && block.type != CellType::quad)
      throw Error(ErrorKind::usage, std::string(format) + " holds triangles only; choose .vtp or .vtu");
    const int n = vertex_count(block.type);
    const auto& order = mirrored_order(block.type);
    for (std::int64_t c = 0; c < block.size; ++c) {
      std::array<VertexId, 4> v{};
      for (int k = 0; k < n; ++k) v[k] = block.vertices[c * n + (mesh.mirrored ? order[k] : k)];
      if (n == 4 && std::min(v[1], v[3]) < std::min(v[0], v[2])) v = {v[1], v[2], v[3], v[0]};
      for (int k = 2; k < n; ++k) {
        result.vertices.push_back({v[0], v[k - 1], v[k]});
        result.groups.push_back(block.groups[c]);
      }
    }
  }
  return result;
}

}  // namespace

void write_stl(const MeshSource& mesh, OutputFile& file, const Execution& execution) {
  const Triangles all = triangles_of(mesh, ".stl");
  std::vector<double> xyz(static_cast<std::size_t>(3 * mesh.point_count));
  mesh.points(0, mesh.point_count, xyz.data());
  std::vector<std::vector<std::uint32_t>> by_group(mesh.groups.size());
  for (std::size_t t = 0; t < all.groups.size(); ++t) by_group[all.groups[t]].push_back(static_cast<std::uint32_t>(t));
  const auto vector = [&](std::string& to, const char* before, const double* x) {
    to += before;
    for (int d = 0; d < 3; ++d) {
      to += ' ';
      append_number(to, x[d]);
    }
    to += '\n';
  };
  for (std::size_t g = 0; g < by_group.size(); ++g) {
    if (by_group[g].empty()) continue;
    std::string name;  // one word, as most readers want it
    for (const std::int32_t label : mesh.groups[g].values) name += (name.empty() ? "" : "_") + std::to_string(label);
    file.write("solid " + name + "\n");
    write_chunks(file, execution, std::ssize(by_group[g]), kChunk,
                 [&](std::int64_t begin, std::int64_t end, std::string& to) {
                   for (std::int64_t i = begin; i < end; ++i) {
                     const auto& v = all.vertices[by_group[g][static_cast<std::size_t>(i)]];
                     std::array<Vec<3>, 3> p;
                     for (int k = 0; k < 3; ++k)
                       for (int d = 0; d < 3; ++d) p[k][d] = xyz[std::size_t{3} * v[k] + static_cast<std::size_t>(d)];
                     const Vec<3> n = cross(p[1] - p[0], p[2] - p[0]);
                     const Vec<3> unit = (1 / norm(n)) * n;
                     vector(to, "facet normal", unit.data());
                     to += "outer loop\n";
                     for (const Vec<3>& corner : p) vector(to, "vertex", corner.data());
                     to += "endloop\nendfacet\n";
                   }
                 });
    file.write("endsolid " + name + "\n");
  }
}

void write_ply(const MeshSource& mesh, OutputFile& file, const Execution& execution) {
  const Triangles all = triangles_of(mesh, ".ply");
  std::string head = "ply\nformat binary_little_endian 1.0\n" + describe_frame(mesh, "comment ") + "element vertex " +
                     std::to_string(mesh.point_count) +
                     "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
                     std::to_string(all.vertices.size()) + "\nproperty list uchar uint vertex_indices\n";
  for (const std::string& name : mesh.array_names) head += "property int " + name + "\n";
  file.write(head + "end_header\n");
  write_chunks(file, execution, mesh.point_count, kChunk, [&](std::int64_t begin, std::int64_t end, std::string& to) {
    std::vector<double> xyz(static_cast<std::size_t>(3 * (end - begin)));
    mesh.points(begin, end, xyz.data());
    to.assign(reinterpret_cast<const char*>(xyz.data()), xyz.size() * sizeof(double));
  });
  write_chunks(file, execution, std::ssize(all.vertices), kChunk,
               [&](std::int64_t begin, std::int64_t end, std::string& to) {
                 for (std::int64_t t = begin; t < end; ++t) {
                   append_bytes(to, std::uint8_t{3});
                   for (const VertexId v : all.vertices[static_cast<std::size_t>(t)]) append_bytes(to, v);
                   for (const std::int32_t label : mesh.groups[all.groups[static_cast<std::size_t>(t)]].values)
                     append_bytes(to, label);
                 }
               });
}

}  // namespace treemarch
