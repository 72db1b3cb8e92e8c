#include "treemarch/mesh/write_mesh.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/mesh_source.h"
#include "treemarch/mesh/output_file.h"

namespace treemarch {
namespace {

enum class Format { vtu, msh, medit, xdmf, vtp, stl, ply };

bool is_for_surfaces(Format format) { return format >= Format::vtp; }

Format format_of(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".vtu") return Format::vtu;
  if (extension == ".msh") return Format::msh;
  if (extension == ".mesh") return Format::medit;
  if (extension == ".xdmf") return Format::xdmf;
  if (extension == ".vtp") return Format::vtp;
  if (extension == ".stl") return Format::stl;
  if (extension == ".ply") return Format::ply;
  throw Error(ErrorKind::usage, path + ": unknown output extension \"" + extension +
                                    "\"; use .vtu, .msh, .mesh or .xdmf, or for surfaces .vtp, .stl or .ply");
}

void write_xdmf(const std::string& path, const MeshSource& source, const WriteOptions& options, OutputFile& text,
                const Execution& execution) {
  if (source.blocks.size() != 1)
    throw Error(ErrorKind::usage, path + ": XDMF is written for meshes of one type of cell; choose .vtu");
  const std::string arrays = xdmf_arrays_path(path);
  OutputFile file(arrays, options.overwrite);
  write_xdmf_arrays(source, options.compress, arrays, file.temporary_path(), execution);
  text.write(xdmf_text(source, std::filesystem::path(arrays).filename().string()));
  file.commit();
}

void write_source(const std::string& path, const MeshSource& source, const WriteOptions& options,
                  const Execution& execution) {
  const Format format = format_of(path);
  OutputFile file(path, options.overwrite);
  if (format == Format::vtu) write_vtu(source, options.compress, file, execution);
  if (format == Format::msh) write_msh(source, file, execution);
  if (format == Format::medit) write_medit(source, file, execution);
  if (format == Format::xdmf) write_xdmf(path, source, options, file, execution);
  if (format == Format::vtp) write_vtp(source, options.compress, file, execution);
  if (format == Format::stl) write_stl(source, file, execution);
  if (format == Format::ply) write_ply(source, file, execution);
  file.commit();
}

/// One line, without what the formats use as delimiters.
std::string cleaned(std::string name) {
  for (char& c : name)
    if (static_cast<unsigned char>(c) < ' ' || c == '"' || c == '\'' || c == '\\') c = '_';
  return name;
}

std::string name_of(const std::vector<std::int32_t>& labels, const std::vector<std::string>& names, MaterialId m) {
  if (m == kOutside) return "outside";
  if (m < names.size() && !names[m].empty()) return names[m];
  return "label " + std::to_string(labels[m]);
}

/// All but the cells: points are taken through `chosen`, or all of them where that is empty.
template <int Dim>
MeshSource source_of(const Mesh<Dim>& mesh, const Frame<Dim>& frame, const std::vector<VertexId>& chosen) {
  MeshSource source;
  source.point_count = static_cast<std::int64_t>(chosen.empty() ? mesh.points.size() : chosen.size());
  constexpr int kCoordinates = std::max(Dim, 3);
  source.coordinates = kCoordinates;
  source.points = [&mesh, &chosen, frame](std::int64_t begin, std::int64_t end, double* to) {
    for (std::int64_t i = begin; i < end; ++i, to += kCoordinates) {
      const Vec<Dim> w = to_world(frame, mesh.points[chosen.empty() ? i : chosen[i]]);
      std::fill(std::copy(w.begin(), w.end(), to), to + kCoordinates, 0.0);
    }
  };
  source.mirrored = is_left_handed(frame);
  source.space = frame.space;
  constexpr int kSide = kCoordinates + 1;
  source.affine.assign(kSide * kSide, 0.0);
  for (int r = Dim; r < kSide; ++r)
    source.affine[kSide * r + r] = 1;  // the axis that a 2D image lacks, and the last row
  for (int r = 0; r < Dim; ++r) {
    for (int c = 0; c < Dim; ++c) source.affine[kSide * r + c] = frame.direction[c][r] * frame.spacing[c];
    source.affine[kSide * r + kCoordinates] = frame.origin[r];
  }
  source.outside = outside_label(mesh.labels);
  for (std::size_t m = 0; m < mesh.names.size(); ++m) {
    source.labels.push_back(mesh.labels[m]);
    source.names.push_back(cleaned(mesh.names[m]));
  }
  return source;
}

/// Puts the extras into the source as arrays. \return what the source refers to.
std::vector<std::vector<std::int32_t>> add_extras(const MeshExtras& extras, MeshSource& source) {
  std::vector<std::vector<std::int32_t>> marks;
  if (!extras.cell_part.empty()) {
    source.cell_arrays.push_back({"partition", extras.cell_part.data()});
    source.point_arrays.push_back({"partition", extras.vertex_part.data()});
  }
  for (const NodeSet& set : extras.node_sets) {
    std::vector<std::int32_t>& mark = marks.emplace_back(static_cast<std::size_t>(source.point_count));
    for (const VertexId v : set.vertices) mark[v] = 1;
    source.point_arrays.push_back({set.name, mark.data()});
  }
  return marks;
}

/// Facets with their own numbering of points and groups.
struct CompactFacets {
  std::vector<VertexId> chosen;                          ///< mesh vertex of each point
  std::vector<std::pair<MaterialId, MaterialId>> pairs;  ///< of each group
  std::vector<std::vector<VertexId>> vertices;           ///< per block
  std::vector<std::vector<std::uint32_t>> groups;        ///< per block
};

CompactFacets compacted(const std::vector<FacetBlock>& facets, std::size_t points) {
  CompactFacets result;
  std::vector<VertexId> number(points);
  for (const FacetBlock& block : facets)
    for (const VertexId v : block.vertices) number[v] = 1;
  for (std::size_t v = 0; v < points; ++v) {
    if (!number[v]) continue;
    number[v] = static_cast<VertexId>(result.chosen.size());
    result.chosen.push_back(static_cast<VertexId>(v));
  }

  for (const FacetBlock& block : facets)
    for (std::int64_t i = 0; i < block.size(); ++i) result.pairs.emplace_back(block.first[i], block.second[i]);
  std::sort(result.pairs.begin(), result.pairs.end());
  result.pairs.erase(std::unique(result.pairs.begin(), result.pairs.end()), result.pairs.end());

  for (const FacetBlock& block : facets) {
    std::vector<VertexId>& vertices = result.vertices.emplace_back(block.vertices);
    for (VertexId& v : vertices) v = number[v];
    std::vector<std::uint32_t>& groups = result.groups.emplace_back(block.first.size());
    for (std::int64_t i = 0; i < block.size(); ++i)
      groups[i] = static_cast<std::uint32_t>(
          std::lower_bound(result.pairs.begin(), result.pairs.end(), std::pair(block.first[i], block.second[i])) -
          result.pairs.begin());
  }
  return result;
}

}  // namespace

void check_mesh_path(const std::string& path, bool overwrite) {
  if (is_for_surfaces(format_of(path)))
    throw Error(ErrorKind::usage, path + ": is a format of surfaces; choose .vtu, .msh, .mesh or .xdmf, or --surface");
  check_surface_path(path, overwrite);
}

void check_surface_path(const std::string& path, bool overwrite, int dim) {
  const Format format = format_of(path);
  if (dim == 2 && (format == Format::stl || format == Format::ply))
    throw Error(ErrorKind::usage, path + ": holds triangles, but the boundaries of a 2D mesh are lines; choose .vtp");
  if (format == Format::xdmf) const OutputFile arrays(xdmf_arrays_path(path), overwrite);
  const OutputFile probe(path, overwrite);
}

std::int32_t outside_label(const std::vector<std::int32_t>& labels) {
  const std::set<std::int32_t> taken(labels.begin(), labels.end());
  std::int32_t value = -1;
  while (taken.count(value)) --value;
  return value;
}

template <int Dim>
void write_mesh(const std::string& path, const Mesh<Dim>& mesh, const Frame<Dim>& frame, const WriteOptions& options,
                const Execution& execution, const MeshExtras& extras) {
  if (is_for_surfaces(format_of(path)))
    throw Error(ErrorKind::usage, path + ": is a format of surfaces; choose .vtu, .msh, .mesh or .xdmf");
  if (!extras.empty() && format_of(path) == Format::medit)
    throw Error(ErrorKind::usage, path + ": holds no node sets and no partition; choose .vtu, .xdmf or .msh");
  if (Dim == 4 && format_of(path) != Format::xdmf)
    throw Error(ErrorKind::usage, path + ": a mesh of four dimensions is written as .xdmf; choose that extension");
  const std::vector<VertexId> all;
  MeshSource source = source_of(mesh, output_frame(frame, options.space), all);
  source.cell_dimension = Dim;
  source.array_names = {"label"};
  for (MaterialId m = 0; m < mesh.labels.size(); ++m)
    source.groups.push_back({{mesh.labels[m]}, cleaned(name_of(mesh.labels, mesh.names, m))});
  for (const CellBlock& b : mesh.blocks)
    if (b.size()) source.blocks.push_back({b.type, b.size(), b.vertices.data(), b.materials.data()});
  const auto marks = add_extras(extras, source);
  write_source(path, source, options, execution);
}

template <int Dim>
void write_interfaces(const std::string& path, const Mesh<Dim>& mesh, const std::vector<FacetBlock>& facets,
                      const Frame<Dim>& frame, const WriteOptions& options, const Execution& execution) {
  const CompactFacets compact = compacted(facets, mesh.points.size());
  MeshSource source = source_of(mesh, output_frame(frame, options.space), compact.chosen);
  source.cell_dimension = Dim - 1;
  source.point_count = static_cast<std::int64_t>(compact.chosen.size());
  source.array_names = {"label_first", "label_second"};
  auto label = [&](MaterialId m) { return m == kOutside ? source.outside : mesh.labels[m]; };
  for (const auto& [first, second] : compact.pairs)
    source.groups.push_back(
        {{label(first), label(second)},
         cleaned(name_of(mesh.labels, mesh.names, first) + " | " + name_of(mesh.labels, mesh.names, second))});
  for (std::size_t b = 0; b < facets.size(); ++b)
    source.blocks.push_back({facets[b].type, facets[b].size(), compact.vertices[b].data(), compact.groups[b].data()});
  write_source(path, source, options, execution);
}

template void write_mesh(const std::string&, const Mesh<2>&, const Frame<2>&, const WriteOptions&, const Execution&,
                         const MeshExtras&);
template void write_mesh(const std::string&, const Mesh<3>&, const Frame<3>&, const WriteOptions&, const Execution&,
                         const MeshExtras&);
template void write_mesh(const std::string&, const Mesh<4>&, const Frame<4>&, const WriteOptions&, const Execution&,
                         const MeshExtras&);
template void write_interfaces(const std::string&, const Mesh<2>&, const std::vector<FacetBlock>&, const Frame<2>&,
                               const WriteOptions&, const Execution&);
template void write_interfaces(const std::string&, const Mesh<3>&, const std::vector<FacetBlock>&, const Frame<3>&,
                               const WriteOptions&, const Execution&);

}  // namespace treemarch
