// XDMF and HDF5 as write_xdmf.cpp writes them.
#include <filesystem>
#include <pugixml.hpp>

#include "treemarch/mesh/hdf5_handle.h"
#include "treemarch/mesh/mesh_input.h"

namespace treemarch {
namespace {

// A compressed array is at most this many times larger than the file that holds it.
constexpr double kLargestRatio = 1100;

class Hdf5Reader {
 public:
  explicit Hdf5Reader(const std::string& path) {
    std::error_code error;
    bytes_ = static_cast<double>(std::filesystem::file_size(path, error));
    if (error) throw BadFile("lacks its arrays, which should be in " + path);
    file_ = {H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose};
    if (!file_.is_open()) throw BadFile("has arrays that are no HDF5 file");
  }

  [[nodiscard]] bool has(const char* name) const { return H5Lexists(file_, name, H5P_DEFAULT) > 0; }

  /// All items of an array; `columns` is set to those of an array of two axes, 0 for one.
  template <class T>
  std::vector<T> array(const char* name, int* columns = nullptr) const {
    const Hdf5Handle data = open(name);
    std::vector<T> values(count_of(data, name, columns));
    if (!values.empty() && H5Dread(data, type_of(T{}), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
      throw BadFile("has a damaged array \"" + std::string(name) + "\"");
    return values;
  }
  /// Texts of one length, without the zeros at their ends.
  [[nodiscard]] std::vector<std::string> texts(const char* name) const {
    const Hdf5Handle data = open(name);
    const Hdf5Handle type(H5Dget_type(data), H5Tclose);
    const std::size_t length =
        H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 ? H5Tget_size(type) : 0;
    const std::size_t count = count_of(data, name, nullptr);
    if (length == 0 || static_cast<double>(length) * static_cast<double>(count) > kLargestRatio * bytes_)
      throw BadFile("has an array \"" + std::string(name) + "\" that is no list of texts");
    std::string bytes(length * count, '\0');
    if (H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0)
      throw BadFile("has a damaged array \"" + std::string(name) + "\"");
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < count; ++i) texts.emplace_back(bytes.substr(i * length, length).c_str());
    return texts;
  }

 private:
  static hid_t type_of(double) { return H5T_NATIVE_DOUBLE; }
  static hid_t type_of(std::int64_t) { return H5T_NATIVE_INT64; }
  static hid_t type_of(std::int32_t) { return H5T_NATIVE_INT32; }

  [[nodiscard]] Hdf5Handle open(const char* name) const {
    if (!has(name)) throw BadFile("has no array \"" + std::string(name) + "\"");
    Hdf5Handle data(H5Dopen2(file_, name, H5P_DEFAULT), H5Dclose);
    if (!data.is_open()) throw BadFile("has no array \"" + std::string(name) + "\"");
    return data;
  }
  std::size_t count_of(const Hdf5Handle& data, const char* name, int* columns) const {
    const Hdf5Handle space(H5Dget_space(data), H5Sclose);
    hsize_t extent[2] = {0, 0};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 1 || rank > 2 || H5Sget_simple_extent_dims(space, extent, nullptr) < 0)
      throw BadFile("has an array \"" + std::string(name) + "\" that is no list or table");
    if (columns) *columns = static_cast<int>(std::min<hsize_t>(extent[1], 1000));
    const double count = static_cast<double>(extent[0]) * (rank == 2 ? static_cast<double>(extent[1]) : 1);
    if (count > kLargestRatio * bytes_) throw BadFile("counts more than it can hold");
    return static_cast<std::size_t>(count);
  }

  Hdf5Handle file_;
  double bytes_ = 0;
};

CellType type_of(std::string_view name) {
  constexpr std::pair<std::string_view, CellType> kTypes[] = {
      {"Polyline", CellType::line},           {"Triangle", CellType::triangle}, {"Quadrilateral", CellType::quad},
      {"Tetrahedron", CellType::tetrahedron}, {"Pyramid", CellType::pyramid},   {"Hexahedron", CellType::hexahedron},
      {"Polyvertex", CellType::pentatope}};
  for (const auto& [text, type] : kTypes)
    if (name == text) return type;
  throw BadFile("has cells of type \"" + std::string(name.substr(0, 20)) + "\"");
}

struct Description {
  std::string arrays;  ///< file that holds them, relative to the text
  CellType type{};
};

Description described(std::string_view text) {
  pugi::xml_document document;
  if (!document.load_buffer(text.data(), text.size())) throw BadFile("is not XML");
  const pugi::xml_node topology = document.child("Xdmf").child("Domain").child("Grid").child("Topology");
  const std::string_view cells = topology.child("DataItem").text().get();
  const std::size_t end = cells.rfind(":/cells");
  if (end == std::string_view::npos)
    throw BadFile("is not XDMF as treemarch writes it (one grid with its arrays in an HDF5 file)");
  return {std::string(cells.substr(0, end)), type_of(topology.attribute("TopologyType").value())};
}

}  // namespace

MeshInput read_xdmf(std::string_view text, const std::string& path) {
  const Hdf5Quiet quiet;
  const Description description = described(text);
  const Hdf5Reader file((std::filesystem::path(path).parent_path() / description.arrays).string());
  MeshInput mesh;
  int width = 0;
  const std::vector<double> coordinates = file.array<double>("points", &width);
  const auto fill = [&](auto& points, std::size_t n) {
    points.resize(coordinates.size() / n);
    for (std::size_t i = 0; i < coordinates.size(); ++i) points[i / n][i % n] = coordinates[i];
  };
  MeshInput::Cells& cells = mesh.cells.emplace_back();
  cells.type = description.type;
  if (width != (cells.type == CellType::pentatope ? 4 : 3))
    throw BadFile("has points of another dimension than its cells");
  if (width == 4)
    fill(mesh.space_time_points, 4);
  else
    fill(mesh.points, 3);
  cells.vertices = file.array<std::int64_t>("cells", &width);
  cells.labels = file.array<std::int32_t>("label");
  if (width != vertex_count(cells.type) ||
      cells.vertices.size() != cells.labels.size() * static_cast<std::size_t>(width))
    throw BadFile("has arrays that do not fit its cells");
  if (file.has("label_values") && file.has("label_names")) {
    const auto values = file.array<std::int32_t>("label_values");
    const auto names = file.texts("label_names");
    for (std::size_t i = 0; i < std::min(values.size(), names.size()); ++i)
      mesh.names.emplace_back(values[i], names[i]);
  }
  if (file.has("affine")) mesh.record.affine = file.array<double>("affine");
  if (file.has("space"))
    for (const std::string& s : file.texts("space")) mesh.record.space = s;
  return mesh;
}

}  // namespace treemarch
