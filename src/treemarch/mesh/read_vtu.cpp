#include <zlib.h>

#include <atomic>
#include <pugixml.hpp>

#include "treemarch/core/parallel.h"
#include "treemarch/mesh/mesh_input.h"

namespace treemarch {
namespace {

/// Base64, in which each part may be padded on its own (VTK encodes a header and its data apart). Ends at the first
/// other character.
std::string decode_base64(std::string_view text) {
  std::array<std::int8_t, 256> value;
  value.fill(-1);
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < kDigits.size(); ++i)
    value[static_cast<unsigned char>(kDigits[i])] = static_cast<std::int8_t>(i);
  std::string bytes;
  for (std::size_t i = 0; i + 4 <= text.size(); i += 4) {
    std::uint32_t word = 0;
    int digits = 0;
    for (int k = 0; k < 4; ++k) {
      const int v = value[static_cast<unsigned char>(text[i + k])];
      if (v >= 0 && digits == k) ++digits;
      word = word << 6U | static_cast<std::uint32_t>(std::max(0, v));
    }
    for (int k = 0; k < digits - 1; ++k) bytes += static_cast<char>(word >> (16U - 8U * static_cast<unsigned>(k)));
    if (digits < 2 || (digits < 4 && text[i + 3] != '=')) break;
  }
  return bytes;
}

class VtuReader {
 public:
  VtuReader(std::string_view file, const Execution& execution) : execution_(execution) {
    // What is appended is no XML: parse the text before it.
    constexpr std::string_view kTag = "<AppendedData";
    const std::size_t appended = file.find(kTag);
    std::string text(file.substr(0, appended));
    if (appended != std::string_view::npos) {
      Cursor tail(file.substr(appended));
      raw_ = file.substr(appended, 60).find("\"raw\"") != std::string_view::npos;
      tail.skip_past("_");
      appended_ = tail.take(tail.remaining());
      text += "</VTKFile>";
    }
    if (!document_.load_buffer(text.data(), text.size())) throw BadFile("is not XML as VTK writes it");
    const pugi::xml_node root = document_.child("VTKFile");
    if (std::string_view(root.attribute("type").value()) != "UnstructuredGrid")
      throw BadFile("is not an unstructured grid of VTK");
    if (std::string_view(root.attribute("byte_order").value()) == "BigEndian")
      throw BadFile("is big-endian; write it on a common machine");
    wide_header_ = std::string_view(root.attribute("header_type").value()) == "UInt64";
    const std::string_view compressor = root.attribute("compressor").value();
    compressed_ = !compressor.empty();
    if (compressed_ && compressor != "vtkZLibDataCompressor")
      throw BadFile("is compressed by something else than zlib");
    grid_ = root.child("UnstructuredGrid");
  }

  MeshInput run() {
    MeshInput mesh;
    const pugi::xml_node piece = grid_.child("Piece");
    if (!piece || piece.next_sibling("Piece")) throw BadFile("does not have exactly one piece");
    const auto xyz = values<double>(piece.child("Points").child("DataArray"));
    if (xyz.size() % 3 != 0) throw BadFile("has points without three coordinates");
    mesh.points.resize(xyz.size() / 3);
    for (std::size_t i = 0; i < xyz.size(); ++i) mesh.points[i / 3][i % 3] = xyz[i];

    const pugi::xml_node label = named(piece.child("CellData"), "label");
    if (!label) throw BadFile("has no cell array \"label\"");
    const pugi::xml_node cells = piece.child("Cells");
    split_cells(values<std::int64_t>(named(cells, "connectivity")), values<std::int64_t>(named(cells, "offsets")),
                values<std::int64_t>(named(cells, "types")), values<std::int64_t>(label), mesh);
    read_names(mesh);
    return mesh;
  }

 private:
  static pugi::xml_node named(const pugi::xml_node& parent, const char* name) {
    return parent.find_child_by_attribute("DataArray", "Name", name);
  }

  static void split_cells(const std::vector<std::int64_t>& connectivity, const std::vector<std::int64_t>& offsets,
                          const std::vector<std::int64_t>& types, const std::vector<std::int64_t>& labels,
                          MeshInput& mesh) {
    if (offsets.size() != types.size() || labels.size() != types.size())
      throw BadFile("has cell arrays of different lengths");
    constexpr std::pair<std::int64_t, CellType> kTypes[] = {{3, CellType::line},        {5, CellType::triangle},
                                                            {9, CellType::quad},        {10, CellType::tetrahedron},
                                                            {12, CellType::hexahedron}, {14, CellType::pyramid}};
    // Cells come in long runs of one type.
    std::int64_t begin = 0;
    for (std::size_t first = 0, last = 0; first < types.size(); first = last) {
      const auto* type =
          std::find_if(std::begin(kTypes), std::end(kTypes), [&](auto& t) { return t.first == types[first]; });
      if (type == std::end(kTypes)) throw BadFile("has cells of VTK type " + std::to_string(types[first]));
      MeshInput::Cells& cells = mesh.cells.emplace_back();
      cells.type = type->second;
      std::int64_t end = begin;
      for (; last < types.size() && types[last] == types[first]; ++last) {
        end += vertex_count(cells.type);
        if (offsets[last] != end || end > static_cast<std::int64_t>(connectivity.size()))
          throw BadFile("has offsets that do not fit its cells");
        if (labels[last] != static_cast<std::int32_t>(labels[last])) throw BadFile("has a label beyond 32 bit");
      }
      cells.vertices.assign(connectivity.begin() + begin, connectivity.begin() + end);
      cells.labels.assign(labels.begin() + static_cast<std::int64_t>(first),
                          labels.begin() + static_cast<std::int64_t>(last));
      begin = end;
    }
  }

  void read_names(MeshInput& mesh) {
    const pugi::xml_node field = grid_.child("FieldData");
    if (!named(field, "label_values") || !named(field, "label_names")) return;
    std::string text;
    for (const std::int64_t c : values<std::int64_t>(named(field, "label_names"))) text += static_cast<char>(c);
    Cursor lines(text);
    for (const std::int64_t label : values<std::int64_t>(named(field, "label_values")))
      mesh.names.emplace_back(static_cast<std::int32_t>(label), lines.line());
  }

  /// The numbers of an array, whatever their type and encoding.
  template <class T>
  std::vector<T> values(const pugi::xml_node& array) {
    if (!array) throw BadFile("lacks an array of points or cells");
    const std::string_view format = array.attribute("format").value();
    if (format == "ascii") {
      std::vector<T> result;
      for (Cursor in(array.text().get()); in.skip_space(), !in.at_end();) result.push_back(in.number<T>());
      return result;
    }
    const std::string bytes = format == "appended" ? appended_bytes(array) : inline_bytes(array);
    const std::string_view type = array.attribute("type").value();
    if (type == "Float64") return converted<T, double>(bytes);
    if (type == "Float32") return converted<T, float>(bytes);
    if (type == "Int64" || type == "UInt64") return converted<T, std::int64_t>(bytes);
    if (type == "Int32") return converted<T, std::int32_t>(bytes);
    if (type == "UInt32") return converted<T, std::uint32_t>(bytes);
    if (type == "Int16") return converted<T, std::int16_t>(bytes);
    if (type == "UInt16") return converted<T, std::uint16_t>(bytes);
    if (type == "Int8") return converted<T, std::int8_t>(bytes);
    if (type == "UInt8") return converted<T, std::uint8_t>(bytes);
    throw BadFile("has an array of unknown type");
  }

  template <class T, class From>
  static std::vector<T> converted(const std::string& bytes) {
    if constexpr (std::is_integral_v<T> && std::is_floating_point_v<From>)
      throw BadFile("has fractions where whole numbers should be");
    std::vector<T> result(bytes.size() / sizeof(From));
    for (std::size_t i = 0; i < result.size(); ++i) {
      From value;
      std::memcpy(&value, bytes.data() + i * sizeof value, sizeof value);
      result[i] = static_cast<T>(value);
    }
    return result;
  }

  std::string inline_bytes(const pugi::xml_node& array) {
    Cursor text(array.text().get());
    return unpacked(decode_base64(text.word()));
  }

  std::string appended_bytes(const pugi::xml_node& array) {
    const std::uint64_t offset = array.attribute("offset").as_ullong();
    if (offset > appended_.size()) throw BadFile("ends too early");
    const std::string_view from = appended_.substr(offset);
    return raw_ ? unpacked(from) : unpacked(decode_base64(from));
  }

  std::uint64_t header_number(Cursor& in) const {
    return wide_header_ ? in.binary<std::uint64_t>() : in.binary<std::uint32_t>();
  }

  std::string unpacked(std::string_view packed) const {
    Cursor in(packed);
    const std::uint64_t first = header_number(in);
    if (!compressed_) return std::string(in.take(in.checked_count(first, 1)));
    const std::size_t blocks = in.checked_count(first, wide_header_ ? 8 : 4);
    const std::uint64_t block_size = header_number(in), last_size = header_number(in);
    if (blocks == 0) return {};
    std::vector<std::uint64_t> sizes(blocks);
    for (std::uint64_t& s : sizes) s = header_number(in);
    std::vector<std::string_view> parts;
    for (const std::uint64_t s : sizes) parts.push_back(in.take(in.checked_count(s, 1)));
    // A byte of zlib holds 1032 at most: what claims more is damaged, and is not worth its memory.
    const std::uint64_t limit = 1100 * (static_cast<std::uint64_t>(packed.size()) + 64);
    if (block_size == 0 || last_size > block_size || (blocks - 1) > limit / block_size)
      throw BadFile("has damaged compressed data");
    const std::uint64_t total = (blocks - 1) * block_size + (last_size ? last_size : block_size);
    if (total > limit) throw BadFile("has damaged compressed data");
    std::string result(total, '\0');
    std::atomic<bool> damaged = false;
    parallel_for(execution_, static_cast<std::int64_t>(blocks), 1, [&](std::int64_t b) {
      const std::uint64_t begin = static_cast<std::uint64_t>(b) * block_size;
      const std::uint64_t want = std::min(block_size, result.size() - begin);
      uLongf size = want;
      if (uncompress(reinterpret_cast<Bytef*>(result.data() + begin), &size,
                     reinterpret_cast<const Bytef*>(parts[b].data()), parts[b].size()) != Z_OK ||
          size != want)
        damaged = true;
    });
    if (damaged) throw BadFile("has damaged compressed data");
    return result;
  }

  const Execution& execution_;
  pugi::xml_document document_;
  pugi::xml_node grid_;
  std::string_view appended_;
  bool raw_ = false, wide_header_ = false, compressed_ = false;
};

}  // namespace

MeshInput read_vtu(std::string_view file, const Execution& execution) { return VtuReader(file, execution).run(); }

}  // namespace treemarch
