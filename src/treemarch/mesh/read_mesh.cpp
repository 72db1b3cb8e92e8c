#include "treemarch/mesh/read_mesh.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <new>

#include "treemarch/core/error.h"
#include "treemarch/mesh/mesh_input.h"

namespace treemarch {
namespace {

std::string read_file(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw Error(ErrorKind::input, path + ": no such file");
  if (fs::is_directory(status)) throw Error(ErrorKind::input, path + ": is a folder, not a mesh");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw Error(ErrorKind::input, path + ": cannot be read: " + std::strerror(errno));
  std::string bytes(fs::is_regular_file(status) ? fs::file_size(path, error) : 0, '\0');
  bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file.get()));
  if (bytes.empty()) throw Error(ErrorKind::input, path + ": is empty");
  return bytes;
}

/// Numbers labels by first appearance.
class Materials {
 public:
  explicit Materials(const MeshInput& input) {
    for (const MeshInput::Cells& c : input.cells)
      for (std::size_t i = 0; i < c.labels.size(); ++i)
        if (i == 0 || c.labels[i] != c.labels[i - 1]) sorted_.push_back(c.labels[i]);
    std::sort(sorted_.begin(), sorted_.end());
    sorted_.erase(std::unique(sorted_.begin(), sorted_.end()), sorted_.end());
    number_.assign(sorted_.size(), kOutside);
  }
  MaterialId of(std::int32_t label, std::vector<std::int32_t>& labels) {
    if (sorted_[last_] != label)
      last_ = static_cast<std::size_t>(std::lower_bound(sorted_.begin(), sorted_.end(), label) - sorted_.begin());
    if (number_[last_] == kOutside) {
      number_[last_] = static_cast<MaterialId>(labels.size());
      labels.push_back(label);
    }
    return number_[last_];
  }

 private:
  std::vector<std::int32_t> sorted_;
  std::vector<MaterialId> number_;
  std::size_t last_ = 0;  // rank of the label asked for before
};

template <int Dim>
Mesh<Dim> assembled(const MeshInput& input) {
  Mesh<Dim> mesh;
  if constexpr (Dim == 4) {
    mesh.points.assign(input.space_time_points.begin(), input.space_time_points.end());
  } else {
    mesh.points.reserve(input.points.size());
    for (const Vec<3>& p : input.points) {
      Vec<Dim>& to = mesh.points.emplace_back();
      std::copy(p.begin(), p.begin() + Dim, to.begin());
    }
  }
  Materials materials(input);
  for (int t = 0; t <= static_cast<int>(CellType::pentatope); ++t) {
    CellBlock block;
    block.type = static_cast<CellType>(t);
    if (dimension(block.type) != Dim) continue;
    std::size_t count = 0;
    for (const MeshInput::Cells& cells : input.cells)
      if (cells.type == block.type) count += cells.labels.size();
    block.vertices.reserve(count * static_cast<std::size_t>(vertex_count(block.type)));
    block.materials.reserve(count);
    for (const MeshInput::Cells& cells : input.cells) {
      if (cells.type != block.type) continue;
      for (const std::int64_t v : cells.vertices) {
        if (v < 0 || v >= std::ssize(mesh.points)) throw BadFile("has a cell with a vertex that does not exist");
        block.vertices.push_back(static_cast<VertexId>(v));
      }
      for (const std::int32_t l : cells.labels) block.materials.push_back(materials.of(l, mesh.labels));
    }
    if (block.size()) mesh.blocks.push_back(std::move(block));
  }
  if (!input.names.empty()) {
    mesh.names.resize(mesh.labels.size());
    for (const auto& [label, name] : input.names) {
      const auto at = std::find(mesh.labels.begin(), mesh.labels.end(), label);
      if (at != mesh.labels.end()) mesh.names[at - mesh.labels.begin()] = name;
    }
  }
  return mesh;
}

AnyMesh assembled_any(const MeshInput& input) {
  int dim = 0;
  for (const MeshInput::Cells& c : input.cells)
    if (!c.labels.empty()) dim = std::max(dim, dimension(c.type));
  for (const Vec<3>& p : input.points)
    if (!std::isfinite(p[0] + p[1] + p[2])) throw BadFile("has a point that is no number");
  for (const Vec<4>& p : input.space_time_points)
    if (!std::isfinite(p[0] + p[1] + p[2] + p[3])) throw BadFile("has a point that is no number");
  if (dim == 4) return assembled<4>(input);
  if (dim == 3) return assembled<3>(input);
  if (dim != 2) throw BadFile("has no cells");
  for (const Vec<3>& p : input.points)
    if (p[2] != 0) throw BadFile("has faces in space but no cells; give a volume mesh or one with z = 0");
  return assembled<2>(input);
}

}  // namespace

AnyMesh read_mesh(const std::string& path, const Execution& execution, MeshRecord* record) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".vtu" && extension != ".msh" && extension != ".mesh" && extension != ".xdmf")
    throw Error(ErrorKind::usage,
                path + ": unknown mesh format \"" + extension + "\"; give .vtu, .msh, .mesh or .xdmf");
  const std::string bytes = read_file(path);
  try {
    const MeshInput input = extension == ".vtu"    ? read_vtu(bytes, execution)
                            : extension == ".msh"  ? read_msh(bytes)
                            : extension == ".mesh" ? read_medit(bytes)
                                                   : read_xdmf(bytes, path);
    if (record) *record = input.record;
    return assembled_any(input);
  } catch (const BadFile& bad) {
    throw Error(ErrorKind::input, path + ": " + bad.what());
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::limits, path + ": does not fit into memory");
  }
}

}  // namespace treemarch
