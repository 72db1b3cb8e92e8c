#include "treemarch/image/read_nrrd.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>

#include "treemarch/core/error.h"
#include "treemarch/image/nrrd_header.h"
#include "treemarch/image/sample_source.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// Which axes of the array are axes of space, and which one (if any) counts volumes.
struct AxisRoles {
  std::vector<std::size_t> space;
  std::optional<std::size_t> volumes;
};

AxisRoles axis_roles(const std::string& path, const NrrdGeometry& geometry) {
  AxisRoles roles;
  const auto& axes = geometry.axes;
  for (std::size_t a = 0; a < axes.size(); ++a) {
    const std::string& kind = axes[a].kind;
    const bool place = kind.empty() || kind == "domain" || kind == "space";
    if (roles.space.size() < 3 && (geometry.has_directions ? !axes[a].direction.empty() && kind != "time" : place)) {
      roles.space.push_back(a);
    } else if (axes[a].size > 1) {
      const bool last = a + 1 == axes.size();
      if (roles.volumes || !((kind == "list" && (last || a == 0)) || (last && (place || kind == "time"))))
        fail(path, "has " + std::to_string(axes[a].size) + " values a voxel (axis " + std::to_string(a + 1) +
                       (kind.empty() ? "" : " of kind " + kind) +
                       "); give an image with one label or grey value a voxel");
      roles.volumes = a;
    }
  }
  if (roles.space.size() < 2) fail(path, "is one-dimensional; give an image of two or three dimensions");
  return roles;
}

void set_geometry(const std::string& path, const NrrdGeometry& geometry, const AxisRoles& roles, RawImage& image) {
  const std::size_t dim = roles.space.size();
  image.dim = static_cast<int>(dim);
  image.space = geometry.space.substr(0, dim);
  image.has_spacing = false;
  for (std::size_t c = 0; c < dim; ++c) {
    const NrrdAxis& axis = geometry.axes[roles.space[c]];
    image.extent[c] = axis.size;
    if (geometry.has_directions) {
      // A vector may be longer than the image has axes (time); a shorter one says too little.
      if (axis.direction.size() < dim) fail(path, "its space directions have too few components; repair the header");
      for (std::size_t r = 0; r < dim; ++r) image.axis[c][r] = axis.direction[r];
      image.has_spacing = true;
    } else if (axis.has_spacing) {
      image.axis[c][c] = axis.spacing;
      image.has_spacing = true;
    }
  }
  if (!geometry.origin.empty()) {
    if (geometry.origin.size() < dim) fail(path, "its space origin has too few components; repair the header");
    for (std::size_t r = 0; r < dim; ++r) image.origin[r] = geometry.origin[r];
  }
  if (roles.volumes) {
    const NrrdAxis& axis = geometry.axes[*roles.volumes];
    image.volumes = axis.size;
    if (std::isfinite(axis.spacing) && axis.spacing > 0) image.volume_spacing = axis.spacing;
  }
}

SampleType sample_type(const std::string& path, const std::string& type) {
  using Names = std::initializer_list<const char*>;
  const auto one_of = [&](Names names) { return std::find(names.begin(), names.end(), type) != names.end(); };
  if (one_of({"uchar", "unsigned char", "uint8", "uint8_t"})) return SampleType::u8;
  if (one_of({"signed char", "int8", "int8_t", "char"})) return SampleType::i8;
  if (one_of({"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"})) return SampleType::u16;
  if (one_of({"short", "short int", "signed short", "signed short int", "int16", "int16_t"})) return SampleType::i16;
  if (one_of({"uint", "unsigned int", "uint32", "uint32_t"})) return SampleType::u32;
  if (one_of({"int", "signed int", "int32", "int32_t"})) return SampleType::i32;
  if (one_of({"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}))
    return SampleType::u64;
  if (one_of(
          {"longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"}))
    return SampleType::i64;
  if (type == "float") return SampleType::f32;
  if (type == "double") return SampleType::f64;
  fail(path, "has samples of type '" + type + "'; convert it to an integer type or to float");
}

/// The data files of a detached header: a name, a list that follows the header, or a pattern with a range.
std::vector<std::string> data_files(const std::string& path, const std::string& field) {
  std::vector<std::string> files;
  if (field.starts_with("LIST")) {
    std::ifstream in(path, std::ios::binary);
    std::string line;
    for (bool listed = false; std::getline(in, line);) {
      while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
      if (listed && !line.empty()) files.push_back(beside(path, line));
      listed = listed || line.find(field) != std::string::npos;
    }
    return files;
  }
  if (field.find('%') == std::string::npos) return {beside(path, field)};
  std::istringstream in(field);
  std::string pattern;
  std::int64_t first = 0, last = -1, step = 1;
  in >> pattern >> first >> last >> step;
  return files_of_pattern(path, pattern, first, last, step);
}

std::int64_t whole_number(const std::string& path, const NrrdHeader& header, const std::string& name,
                          const std::string& other_name) {
  const std::string& text = header.field(name).empty() ? header.field(other_name) : header.field(name);
  if (text.empty()) return 0;
  std::int64_t value = 0;
  std::istringstream in(text);
  if (!(in >> value) || std::abs(value) > (std::int64_t{1} << 50))
    fail(path, "its field '" + name + "' is not a number; repair the header");
  return value;
}

SampleSource sample_source(const std::string& path, const NrrdHeader& header, SampleType type) {
  SampleSource source;
  const std::string& encoding = header.field("encoding");
  if (encoding == "raw")
    source.encoding = SampleEncoding::raw;
  else if (encoding == "gzip" || encoding == "gz")
    source.encoding = SampleEncoding::deflate;
  else if (encoding == "ascii" || encoding == "text" || encoding == "txt")
    source.encoding = SampleEncoding::text;
  else
    fail(path, "has the encoding '" + encoding + "', which is not read; convert it to raw or gzip");
  const std::string& endian = header.field("endian");
  source.big_endian = endian == "big";
  if (source.encoding != SampleEncoding::text && sample_bytes(type) > 1 && endian != "big" && endian != "little")
    fail(path, "does not say its byte order; add 'endian: little' or 'endian: big' to its header");

  const std::string& field = header.field("data file").empty() ? header.field("datafile") : header.field("data file");
  source.skip_lines = whole_number(path, header, "line skip", "lineskip");
  source.skip_bytes = whole_number(path, header, "byte skip", "byteskip");
  if (source.encoding == SampleEncoding::deflate && source.skip_bytes != 0)
    fail(path, "skips bytes of compressed data, which is not read; convert it");
  if (field.empty()) {
    if (source.skip_lines != 0 || source.skip_bytes != 0)
      fail(path, "skips data after its own header, which is not read; convert it");
    source.files = {path};
    source.skip_bytes = static_cast<std::int64_t>(header.bytes);
  } else {
    source.files = data_files(path, field);
  }
  return source;
}

/// Turns volumes that alternate from sample to sample into volumes one after the other.
void deinterleave(RawImage& image) {
  const std::unique_ptr<SampleStream> in = std::move(image.samples);
  std::byte* const out = image.allocate();
  const std::size_t sample = sample_bytes(image.type);
  const auto voxels = static_cast<std::size_t>(image.voxels()), volumes = static_cast<std::size_t>(image.volumes);
  constexpr std::size_t kVoxels = 4096;  // at a time
  std::vector<std::byte> values(kVoxels * volumes * sample);
  for (std::size_t first = 0; first < voxels; first += kVoxels) {
    const std::size_t n = std::min(kVoxels, voxels - first);
    in->read(values.data(), n * volumes * sample);
    for (std::size_t v = 0; v < volumes; ++v)
      for (std::size_t i = 0; i < n; ++i)
        std::memcpy(out + (v * voxels + first + i) * sample, &values[(i * volumes + v) * sample], sample);
  }
}

}  // namespace

RawImage read_nrrd(const std::string& path) {
  const NrrdHeader header = read_nrrd_header(path);
  const NrrdGeometry geometry = nrrd_geometry(path, header);
  const AxisRoles roles = axis_roles(path, geometry);
  std::vector<std::int64_t> sizes;
  for (const NrrdAxis& axis : geometry.axes) sizes.push_back(axis.size);
  RawImage image;
  set_geometry(path, geometry, roles, image);
  image.names = nrrd_segment_names(header);
  image.type = sample_type(path, header.field("type"));
  open_samples(path, sample_source(path, header, image.type), sizes, image);
  if (roles.volumes && *roles.volumes < roles.space.front()) deinterleave(image);
  return image;
}

}  // namespace treemarch
