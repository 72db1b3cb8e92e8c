// XDMF 3: a text that describes arrays, and the arrays in an HDF5 file beside it.
#include <algorithm>
#include <filesystem>

#include "treemarch/core/error.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/hdf5_handle.h"
#include "treemarch/mesh/mesh_source.h"

namespace treemarch {
namespace {

constexpr hsize_t kRowsPerChunk = 1 << 16;
constexpr unsigned kFastest = 1;
const std::string kOfPoints = "point_";  // before the names of arrays of points

/// XDMF has no cells of four dimensions: there they are sets of five points.
constexpr const char* xdmf_type(CellType type) {
  constexpr const char* kTypes[] = {"Polyline", "Triangle",   "Quadrilateral", "Tetrahedron",
                                    "Pyramid",  "Hexahedron", "Polyvertex"};
  return kTypes[static_cast<int>(type)];
}

class Hdf5Writer {
 public:
  Hdf5Writer(std::string path, const std::string& file, bool compress) : path_(std::move(path)), compress_(compress) {
    file_ = {H5Fcreate(file.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), H5Fclose};
    check(file_.is_open());
  }

  /// An array of `rows` rows of `columns` items; fill(begin, end, to) writes rows. One axis where columns is 0.
  template <class T, class Fill>
  void rows(const char* name, std::int64_t count, int columns, const Fill& fill) {
    const hsize_t extent[2] = {static_cast<hsize_t>(count), static_cast<hsize_t>(std::max(1, columns))};
    const int rank = columns > 0 ? 2 : 1;
    const Hdf5Handle space(H5Screate_simple(rank, extent, nullptr), H5Sclose);
    const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    check(H5Pset_obj_track_times(properties, false) >= 0);  // the same mesh gives the same file
    if (compress_ && count > 0) {
      const hsize_t chunk[2] = {std::min(extent[0], kRowsPerChunk), extent[1]};
      check(H5Pset_chunk(properties, rank, chunk) >= 0 && H5Pset_shuffle(properties) >= 0 &&
            H5Pset_deflate(properties, kFastest) >= 0);
    }
    const Hdf5Handle data(H5Dcreate2(file_, name, type_of(T{}), space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
    check(data.is_open());
    std::vector<T> buffer;
    for (hsize_t begin = 0; begin < extent[0]; begin += kRowsPerChunk) {
      const hsize_t start[2] = {begin, 0};
      const hsize_t part[2] = {std::min(kRowsPerChunk, extent[0] - begin), extent[1]};
      buffer.resize(part[0] * part[1]);
      fill(static_cast<std::int64_t>(begin), static_cast<std::int64_t>(begin + part[0]), buffer.data());
      const Hdf5Handle memory(H5Screate_simple(rank, part, nullptr), H5Sclose);
      check(H5Sselect_hyperslab(space, H5S_SELECT_SET, start, nullptr, part, nullptr) >= 0 &&
            H5Dwrite(data, type_of(T{}), memory, space, H5P_DEFAULT, buffer.data()) >= 0);
    }
  }
  template <class T>
  void array(const char* name, const std::vector<T>& values, int columns = 0) {
    const std::int64_t width = std::max(1, columns);
    rows<T>(name, static_cast<std::int64_t>(values.size()) / width, columns,
            [&](std::int64_t begin, std::int64_t end, T* to) {
              std::copy(values.begin() + begin * width, values.begin() + end * width, to);
            });
  }
  /// Texts of one length, in UTF-8.
  void texts(const char* name, const std::vector<std::string>& values) {
    std::size_t longest = 1;
    for (const std::string& v : values) longest = std::max(longest, v.size());
    std::string bytes;
    for (std::string v : values) {
      v.resize(longest, '\0');
      bytes += v;
    }
    const hsize_t extent = values.size();
    const Hdf5Handle space(H5Screate_simple(1, &extent, nullptr), H5Sclose);
    const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
    check(H5Tset_size(type, longest) >= 0 && H5Tset_cset(type, H5T_CSET_UTF8) >= 0 &&
          H5Tset_strpad(type, H5T_STR_NULLPAD) >= 0);
    const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    check(H5Pset_obj_track_times(properties, false) >= 0);
    const Hdf5Handle data(H5Dcreate2(file_, name, type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose);
    check(data.is_open() && H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) >= 0);
  }
  void close() { check(file_.close()); }

 private:
  static hid_t type_of(double) { return H5T_NATIVE_DOUBLE; }
  static hid_t type_of(std::int32_t) { return H5T_NATIVE_INT32; }
  static hid_t type_of(VertexId) { return H5T_NATIVE_UINT32; }

  void check(bool good) const {
    if (!good) throw Error(ErrorKind::output, path_ + ": writing failed; is there enough space?");
  }

  std::string path_;
  bool compress_;
  Hdf5Handle file_;
};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else
      out += c;
  }
  return out;
}

}  // namespace

void write_xdmf_arrays(const MeshSource& mesh, bool compress, const std::string& path, const std::string& file,
                       const Execution& execution) {
  const Hdf5Quiet quiet;
  const MeshSource::Block& block = mesh.blocks.front();
  Hdf5Writer out(path, file, compress);
  out.rows<double>("points", mesh.point_count, mesh.coordinates,
                   [&](std::int64_t begin, std::int64_t end, double* to) { mesh.points(begin, end, to); });
  execution.check();
  const int corners = vertex_count(block.type);
  const auto& order = mirrored_order(block.type);
  out.rows<VertexId>("cells", block.size, corners, [&](std::int64_t begin, std::int64_t end, VertexId* to) {
    for (const VertexId* v = block.vertices + begin * corners; v != block.vertices + end * corners; v += corners)
      for (int k = 0; k < corners; ++k) *to++ = v[mesh.mirrored ? order[k] : k];
  });
  execution.check();
  for (std::size_t a = 0; a < mesh.array_names.size(); ++a)
    out.rows<std::int32_t>(mesh.array_names[a].c_str(), block.size, 0,
                           [&](std::int64_t begin, std::int64_t end, std::int32_t* to) {
                             for (std::int64_t i = begin; i < end; ++i) *to++ = mesh.groups[block.groups[i]].values[a];
                           });
  const auto whole = [&](const std::string& name, const MeshSource::Array& array, std::int64_t count) {
    out.rows<std::int32_t>(name.c_str(), count, 0, [&](std::int64_t begin, std::int64_t end, std::int32_t* to) {
      std::copy(array.values + begin, array.values + end, to);
    });
  };
  for (const MeshSource::Array& array : mesh.cell_arrays) whole(array.name, array, block.size);
  for (const MeshSource::Array& array : mesh.point_arrays) whole(kOfPoints + array.name, array, mesh.point_count);
  out.array("affine", mesh.affine, mesh.affine_side());
  out.array("outside_label", std::vector{mesh.outside});
  out.texts("space", {mesh.space});
  if (!mesh.names.empty()) {
    out.array("label_values", mesh.labels);
    out.texts("label_names", mesh.names);
  }
  out.close();
}

std::string xdmf_text(const MeshSource& mesh, const std::string& arrays) {
  const MeshSource::Block& block = mesh.blocks.front();
  const std::string points = std::to_string(mesh.point_count), cells = std::to_string(block.size),
                    corners = std::to_string(vertex_count(block.type)), width = std::to_string(mesh.coordinates);
  const auto item = [&](const std::string& type, const std::string& dimensions, const std::string& name) {
    return "<DataItem Format=\"HDF\" " + type + " Dimensions=\"" + dimensions + "\">" + escaped(arrays) + ":/" + name +
           "</DataItem>";
  };
  const std::string all_points = item("NumberType=\"Float\" Precision=\"8\"", points + " " + width, "points");
  const auto columns = [&](int first, int count) {  // of the points
    const std::string n = std::to_string(count);
    return "<DataItem ItemType=\"HyperSlab\" Type=\"HyperSlab\" Dimensions=\"" + points + " " + n +
           "\"><DataItem Dimensions=\"3 2\" Format=\"XML\">0 " + std::to_string(first) + " 1 1 " + points + " " + n +
           "</DataItem>" + all_points + "</DataItem>";
  };
  std::string text = "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n<Grid Name=\"mesh\">\n";
  text += "<Topology TopologyType=\"" + std::string(xdmf_type(block.type)) + "\" NumberOfElements=\"" + cells +
          "\" NodesPerElement=\"" + corners + "\">" +
          item("NumberType=\"UInt\" Precision=\"4\"", cells + " " + corners, "cells") + "</Topology>\n";
  text += "<Geometry GeometryType=\"XYZ\">" + (mesh.coordinates > 3 ? columns(0, 3) : all_points) + "</Geometry>\n";
  for (const std::string& name : mesh.array_names)
    text += "<Attribute Name=\"" + name + "\" AttributeType=\"Scalar\" Center=\"Cell\">" +
            item("NumberType=\"Int\" Precision=\"4\"", cells, name) + "</Attribute>\n";
  const auto attribute = [&](const MeshSource::Array& array, const char* centre, const std::string& count,
                             const std::string& prefix) {
    text += "<Attribute Name=\"" + array.name + "\" AttributeType=\"Scalar\" Center=\"" + centre + "\">" +
            item("NumberType=\"Int\" Precision=\"4\"", count, prefix + array.name) + "</Attribute>\n";
  };
  for (const MeshSource::Array& array : mesh.cell_arrays) attribute(array, "Cell", cells, "");
  for (const MeshSource::Array& array : mesh.point_arrays) attribute(array, "Node", points, kOfPoints);
  if (mesh.coordinates > 3)
    text += "<Attribute Name=\"time\" AttributeType=\"Scalar\" Center=\"Node\">" + columns(3, 1) + "</Attribute>\n";
  return text + "</Grid>\n</Domain>\n</Xdmf>\n";
}

std::string xdmf_arrays_path(const std::string& path) {
  return std::filesystem::path(path).replace_extension(".h5").string();
}

}  // namespace treemarch
