// VTK's XML formats for unstructured grids and polygons, version 1.0, arrays appended as raw bytes.
#include <libdeflate.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh_source.h"

namespace treemarch {
namespace {

// Before compression. Several of an array, to compress in parallel, but not many: meshio joins them in time that grows
// with their number times the size of the array.
constexpr std::int64_t kLeastBlockBytes = 1 << 19, kMostBlockBytes = 8 << 20;
constexpr std::int64_t kBlocks = 8;       // of an array, between these sizes
constexpr std::size_t kOffsetWidth = 24;  // room for an offset that is known later
constexpr int kFastest = 1;               // the higher levels gain little and cost much

constexpr int vtk_type(CellType type) {
  constexpr int kTypes[] = {3, 5, 9, 10, 14, 12};
  return kTypes[static_cast<int>(type)];
}

/// An array that follows the XML text.
struct Appended {
  std::string attributes;
  std::int64_t items = 0;
  std::int64_t item_bytes = 0;
  /// Writes items [begin, end).
  std::function<void(std::int64_t begin, std::int64_t end, char* to)> fill;
  std::int64_t offset_position = 0;
};

template <class T>
void put(char* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

/// Calls use(block, first, last, n) for the stretches of [begin, end) in each block, where a block has
/// `per_cell(block)` items a cell; n counts the items from begin on.
template <class PerCell, class Use>
void for_each_stretch(const MeshSource& mesh, std::int64_t begin, std::int64_t end, const PerCell& per_cell,
                      const Use& use) {
  std::int64_t start = 0, done = 0;
  for (const MeshSource::Block& block : mesh.blocks) {
    const std::int64_t size = block.size * per_cell(block);
    const std::int64_t first = std::max<std::int64_t>(0, begin - start);
    const std::int64_t last = std::min(size, end - start);
    if (first < last) {
      use(block, first, last, done);
      done += last - first;
    }
    start += size;
  }
}

std::int64_t one(const MeshSource::Block&) { return 1; }
std::int64_t corners(const MeshSource::Block& block) { return vertex_count(block.type); }

template <class Index>
void add_cells(const MeshSource& mesh, const std::string& type, std::vector<Appended>& arrays) {
  arrays.push_back({"type=\"" + type + "\" Name=\"connectivity\"", mesh.corner_count(), sizeof(Index),
                    [&mesh](std::int64_t begin, std::int64_t end, char* to) {
                      for_each_stretch(mesh, begin, end, corners, [&](auto& b, auto first, auto last, auto done) {
                        const std::int64_t n = corners(b);
                        const auto& order = mirrored_order(b.type);
                        char* p = to + done * static_cast<std::int64_t>(sizeof(Index));
                        for (std::int64_t i = first; i < last; ++i, p += sizeof(Index)) {
                          const std::int64_t from = mesh.mirrored ? i - i % n + order[i % n] : i;
                          put(p, static_cast<Index>(b.vertices[from]));
                        }
                      });
                    }});
  arrays.push_back({"type=\"" + type + "\" Name=\"offsets\"", mesh.cell_count(), sizeof(Index),
                    [&mesh](std::int64_t begin, std::int64_t end, char* to) {
                      for_each_stretch(mesh, begin, end, one, [&](auto& b, auto first, auto last, auto done) {
                        std::int64_t before = 0;
                        for (const MeshSource::Block* e = mesh.blocks.data(); e != &b; ++e)
                          before += e->size * corners(*e);
                        char* p = to + done * static_cast<std::int64_t>(sizeof(Index));
                        for (std::int64_t i = first; i < last; ++i, p += sizeof(Index))
                          put(p, static_cast<Index>(before + (i + 1) * corners(b)));
                      });
                    }});
}

enum class Kind { grid, polygons };

Appended array_of(const MeshSource::Array& array, std::int64_t items) {
  return {"type=\"Int32\" Name=\"" + array.name + "\"", items, 4,
          [values = array.values](std::int64_t begin, std::int64_t end, char* to) {
            std::memcpy(to, values + begin, static_cast<std::size_t>(4 * (end - begin)));
          }};
}

std::vector<Appended> arrays_of(const MeshSource& mesh, Kind kind) {
  std::vector<Appended> arrays;
  arrays.push_back({"type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"", mesh.point_count, 24,
                    [&mesh](std::int64_t begin, std::int64_t end, char* to) {
                      mesh.points(begin, end, reinterpret_cast<double*>(to));
                    }});
  // Half the size where it suffices; VTK wants both arrays alike.
  if (mesh.fits_32_bits())
    add_cells<std::int32_t>(mesh, "Int32", arrays);
  else
    add_cells<std::int64_t>(mesh, "Int64", arrays);
  if (kind == Kind::grid)
    arrays.push_back({"type=\"UInt8\" Name=\"types\"", mesh.cell_count(), 1,
                      [&mesh](std::int64_t begin, std::int64_t end, char* to) {
                        for_each_stretch(mesh, begin, end, one, [&](auto& b, auto first, auto last, auto done) {
                          std::memset(to + done, vtk_type(b.type), static_cast<std::size_t>(last - first));
                        });
                      }});
  for (std::size_t a = 0; a < mesh.array_names.size(); ++a)
    arrays.push_back({"type=\"Int32\" Name=\"" + mesh.array_names[a] + "\"", mesh.cell_count(), 4,
                      [&mesh, a](std::int64_t begin, std::int64_t end, char* to) {
                        for_each_stretch(mesh, begin, end, one, [&](auto& b, auto first, auto last, auto done) {
                          for (std::int64_t i = first; i < last; ++i, ++done)
                            put(to + 4 * done, mesh.groups[b.groups[i]].values[a]);
                        });
                      }});
  for (const MeshSource::Array& array : mesh.cell_arrays) arrays.push_back(array_of(array, mesh.cell_count()));
  for (const MeshSource::Array& array : mesh.point_arrays) arrays.push_back(array_of(array, mesh.point_count));
  return arrays;
}

template <class T>
std::string field(const std::string& type, const std::string& name, std::int64_t components, const T& values) {
  std::string text = "      <DataArray type=\"" + type + "\" Name=\"" + name + "\"";
  if (components > 1) text += " NumberOfComponents=\"" + std::to_string(components) + "\"";
  text += " NumberOfTuples=\"" + std::to_string(static_cast<std::int64_t>(values.size()) / components) +
          "\" format=\"ascii\">\n       ";
  for (const auto v : values) {
    text += ' ';
    if constexpr (std::is_floating_point_v<std::decay_t<decltype(v)>>)
      append_number(text, v);
    else
      append_number(text, static_cast<std::int64_t>(v));
  }
  return text + "\n      </DataArray>\n";
}

/// Text as its bytes: readers other than VTK's refuse arrays of strings.
std::string text_field(const std::string& name, const std::string& value) {
  if (value.empty()) return {};
  return field("UInt8", name, 1, std::vector<std::uint8_t>(value.begin(), value.end()));
}

std::string field_data(const MeshSource& mesh) {
  std::string names;
  for (const std::string& n : mesh.names) names += n + '\n';  // each line ends, so that the last may be empty
  std::string text = "    <FieldData>\n";
  text += text_field("space", mesh.space);
  text += field("Float64", "affine", std::ssize(mesh.affine), mesh.affine);
  text += field("Int32", "outside_label", 1, std::vector{mesh.outside});
  if (!mesh.names.empty()) {
    text += field("Int32", "label_values", 1, mesh.labels);
    text += text_field("label_names", names);
  }
  return text + "    </FieldData>\n";
}

/// The XML text with room for the offsets; notes where they go.
std::string header(const MeshSource& mesh, Kind kind, bool compress, std::vector<Appended>& arrays) {
  const std::string type = kind == Kind::grid ? "UnstructuredGrid" : "PolyData";
  std::string text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"" + type + "\" version=\"1.0\"";
  text += " byte_order=\"LittleEndian\" header_type=\"UInt64\"";
  if (compress) text += " compressor=\"vtkZLibDataCompressor\"";
  text += ">\n  <" + type + ">\n" + field_data(mesh);
  const std::string cells = kind == Kind::grid ? "Cells" : mesh.cell_dimension == 1 ? "Lines" : "Polys";
  text += "    <Piece NumberOfPoints=\"" + std::to_string(mesh.point_count) + "\" NumberOf" + cells + "=\"" +
          std::to_string(mesh.cell_count()) + "\">\n";
  std::size_t next = 0;
  auto section = [&](const std::string& tag, const std::string& attributes, std::size_t count) {
    text += "      <" + tag + attributes + ">\n";
    for (const std::size_t end = next + count; next < end; ++next) {
      text += "        <DataArray " + arrays[next].attributes + " format=\"appended\" offset=\"";
      arrays[next].offset_position = static_cast<std::int64_t>(text.size());
      text += std::string(kOffsetWidth, ' ') + "/>\n";
    }
    text += "      </" + tag + ">\n";
  };
  section("Points", "", 1);
  section(cells, "", kind == Kind::grid ? 3 : 2);
  section("CellData", " Scalars=\"" + mesh.array_names.front() + "\"",
          mesh.array_names.size() + mesh.cell_arrays.size());
  if (!mesh.point_arrays.empty()) section("PointData", "", mesh.point_arrays.size());
  return text + "    </Piece>\n  </" + type + ">\n  <AppendedData encoding=\"raw\">\n_";
}

void append_compressed(const std::string& bytes, std::string& out) {
  const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
      libdeflate_alloc_compressor(kFastest), &libdeflate_free_compressor);
  if (!compressor) throw std::bad_alloc();
  out.resize(libdeflate_zlib_compress_bound(compressor.get(), bytes.size()));
  out.resize(libdeflate_zlib_compress(compressor.get(), bytes.data(), bytes.size(), out.data(), out.size()));
}

/// Writes one array. Compressed: number of blocks, size of a block, size of the last if it is shorter, compressed
/// sizes, then the blocks; else the size and the bytes.
void write_array(const Appended& array, bool compress, OutputFile& file, const Execution& execution) {
  const std::int64_t block_bytes =
      std::clamp(array.items * array.item_bytes / kBlocks, kLeastBlockBytes, kMostBlockBytes);
  const std::int64_t per_block = block_bytes / array.item_bytes;
  auto bytes_of = [&](std::int64_t items) { return static_cast<std::uint64_t>(items * array.item_bytes); };
  if (!compress) {
    const std::uint64_t size = bytes_of(array.items);
    file.write(&size, sizeof size);
    write_chunks(file, execution, array.items, per_block, [&](std::int64_t begin, std::int64_t end, std::string& out) {
      out.resize(bytes_of(end - begin));
      array.fill(begin, end, out.data());
    });
    return;
  }
  const std::int64_t blocks = block_count(array.items, per_block);
  std::vector<std::uint64_t> sizes(3 + static_cast<std::size_t>(blocks));
  const std::int64_t at = file.position();
  file.write(sizes.data(), sizes.size() * 8);
  const std::vector<std::uint64_t> written = write_chunks(file, execution, array.items, per_block,
                                                          [&](std::int64_t begin, std::int64_t end, std::string& out) {
                                                            std::string bytes(bytes_of(end - begin), '\0');
                                                            array.fill(begin, end, bytes.data());
                                                            append_compressed(bytes, out);
                                                          });
  sizes[0] = static_cast<std::uint64_t>(blocks);
  sizes[1] = bytes_of(per_block);
  sizes[2] = bytes_of(array.items % per_block);
  std::copy(written.begin(), written.end(), sizes.begin() + 3);
  file.write_at(at, sizes.data(), sizes.size() * 8);
}

void write_xml(const MeshSource& mesh, Kind kind, bool compress, OutputFile& file, const Execution& execution) {
  std::vector<Appended> arrays = arrays_of(mesh, kind);
  file.write(header(mesh, kind, compress, arrays));
  const std::int64_t start = file.position();
  for (const Appended& array : arrays) {
    // The quote that ends the attribute moves with the number: readers compare the text of the offset.
    std::string offset = std::to_string(file.position() - start) + "\"";
    offset.resize(kOffsetWidth, ' ');
    write_array(array, compress, file, execution);
    file.write_at(array.offset_position, offset.data(), offset.size());
  }
  file.write("\n  </AppendedData>\n</VTKFile>\n");
}

}  // namespace

void write_vtu(const MeshSource& mesh, bool compress, OutputFile& file, const Execution& execution) {
  write_xml(mesh, Kind::grid, compress, file, execution);
}

void write_vtp(const MeshSource& mesh, bool compress, OutputFile& file, const Execution& execution) {
  write_xml(mesh, Kind::polygons, compress, file, execution);
}

}  // namespace treemarch
