#include "treemarch/image/read_metaimage.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "treemarch/core/error.h"
#include "treemarch/image/sample_source.h"

namespace treemarch {
namespace {

constexpr std::size_t kLongestHeader = std::size_t{1} << 20;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// The "Name = value" lines up to ElementDataFile, which is the last by definition.
struct Header {
  std::vector<std::pair<std::string, std::string>> fields;
  std::vector<std::string> list;  ///< the lines after ElementDataFile = LIST
  std::size_t bytes = 0;          ///< length of the header

  /// The value of the first of these names that the header has.
  [[nodiscard]] std::string field(std::initializer_list<const char*> names) const {
    for (const char* name : names)
      for (const auto& [key, value] : fields)
        if (key == name) return value;
    return {};
  }
  [[nodiscard]] bool flag(std::initializer_list<const char*> names) const {
    const std::string value = field(names);
    return !value.empty() && (value[0] == 'T' || value[0] == 't' || value[0] == '1');
  }
};

std::string trimmed(const std::string& s) {
  const auto begin = s.find_first_not_of(" \t\r");
  return begin == std::string::npos ? std::string() : s.substr(begin, s.find_last_not_of(" \t\r") - begin + 1);
}

Header read_header(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  Header header;
  std::string line;
  while (header.bytes < kLongestHeader && std::getline(in, line)) {
    header.bytes += line.size() + 1;
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos) continue;
    header.fields.emplace_back(trimmed(line.substr(0, equals)), trimmed(line.substr(equals + 1)));
    if (header.fields.back().first != "ElementDataFile") continue;
    if (header.fields.back().second.starts_with("LIST"))
      while (std::getline(in, line))
        if (const std::string name = trimmed(line); !name.empty()) header.list.push_back(beside(path, name));
    return header;
  }
  fail(path, "its header has no 'ElementDataFile'; the file is cut short or is not a MetaImage");
}

/// The numbers of a field; empty where it is absent.
std::vector<double> numbers(const std::string& path, const Header& header, std::initializer_list<const char*> names,
                            std::size_t count) {
  std::istringstream in(header.field(names));
  std::vector<double> values;
  for (std::string word; in >> word;) {
    double value = 0;
    const char* end = word.data() + word.size();
    if (std::from_chars(word.data(), end, value).ptr != end)
      fail(path, "its field '" + std::string(*names.begin()) + "' has '" + word +
                     "' where a number should be; repair the header");
    values.push_back(value);
  }
  if (!values.empty() && values.size() != count)
    fail(path, "its field '" + std::string(*names.begin()) + "' has " + std::to_string(values.size()) +
                   " numbers, not " + std::to_string(count) + "; repair the header");
  return values;
}

SampleType sample_type(const std::string& path, const Header& header) {
  const std::string type = header.field({"ElementType"});
  // In this format a LONG has 4 bytes on every machine.
  constexpr std::array<std::pair<const char*, SampleType>, 12> kTypes{{{"MET_UCHAR", SampleType::u8},
                                                                       {"MET_CHAR", SampleType::i8},
                                                                       {"MET_USHORT", SampleType::u16},
                                                                       {"MET_SHORT", SampleType::i16},
                                                                       {"MET_UINT", SampleType::u32},
                                                                       {"MET_INT", SampleType::i32},
                                                                       {"MET_ULONG", SampleType::u32},
                                                                       {"MET_LONG", SampleType::i32},
                                                                       {"MET_ULONG_LONG", SampleType::u64},
                                                                       {"MET_LONG_LONG", SampleType::i64},
                                                                       {"MET_FLOAT", SampleType::f32},
                                                                       {"MET_DOUBLE", SampleType::f64}}};
  for (const auto& [name, sample] : kTypes)
    if (type == name) return sample;
  fail(path, "has elements of type '" + type + "'; convert it to an integer type or to float");
}

std::vector<std::int64_t> read_sizes(const std::string& path, const Header& header) {
  const std::vector<double> dims = numbers(path, header, {"NDims"}, 1);
  if (dims.empty() || !(dims[0] >= 1 && dims[0] <= 10))
    fail(path, "its header has no 'NDims' that can be; the file is damaged or is not a MetaImage");
  const auto count = static_cast<std::size_t>(dims[0]);
  std::vector<std::int64_t> sizes;
  for (const double n : numbers(path, header, {"DimSize"}, count))
    sizes.push_back(n >= 1 && n <= 9e15 ? static_cast<std::int64_t>(n) : 0);
  if (sizes.empty()) fail(path, "its header has no 'DimSize'; the file is damaged or is not a MetaImage");
  std::size_t used = count;
  while (used > 3 && sizes[used - 1] == 1) --used;
  if (used < 2 || used > 4)
    fail(path, "has " + std::to_string(used) + " dimensions; give an image of two or three dimensions");
  return sizes;
}

void set_geometry(const std::string& path, const Header& header, const std::vector<std::int64_t>& sizes,
                  RawImage& image) {
  const std::size_t dims = sizes.size(), space = std::min<std::size_t>(dims, 3);
  image.dim = static_cast<int>(space);
  image.space = std::string("LPS").substr(0, space);
  const auto matrix = numbers(path, header, {"TransformMatrix", "Rotation", "Orientation"}, dims * dims);
  const auto offset = numbers(path, header, {"Offset", "Position", "Origin"}, dims);
  const auto spacing = numbers(path, header, {"ElementSpacing", "ElementSize"}, dims);
  image.has_spacing = !spacing.empty();
  for (std::size_t c = 0; c < space; ++c) {
    image.extent[c] = sizes[c];
    if (!offset.empty()) image.origin[c] = offset[c];
    for (std::size_t r = 0; r < space; ++r) {
      if (!matrix.empty()) image.axis[c][r] = matrix[c * dims + r];
      if (!spacing.empty()) image.axis[c][r] *= spacing[c];
    }
  }
  for (std::size_t d = 3; d < dims; ++d) image.volumes *= sizes[d];
  if (dims > 3 && !spacing.empty() && std::isfinite(spacing[3]) && spacing[3] > 0) image.volume_spacing = spacing[3];
}

SampleSource sample_source(const std::string& path, const Header& header) {
  SampleSource source;
  source.big_endian = header.flag({"BinaryDataByteOrderMSB", "ElementByteOrderMSB"});
  if (header.flag({"CompressedData"})) source.encoding = SampleEncoding::deflate;
  if (!header.field({"BinaryData"}).empty() && !header.flag({"BinaryData"})) source.encoding = SampleEncoding::text;
  if (const auto skip = numbers(path, header, {"HeaderSize"}, 1); !skip.empty())
    source.skip_bytes = std::abs(skip[0]) < 1e15 ? static_cast<std::int64_t>(skip[0]) : 0;

  const std::string name = header.field({"ElementDataFile"});
  if (name == "LOCAL" || name == "Local" || name == "local") {
    source.files = {path};
    source.skip_bytes = static_cast<std::int64_t>(header.bytes);
  } else if (name.starts_with("LIST")) {
    source.files = header.list;
  } else if (name.find('%') != std::string::npos) {
    std::istringstream in(name);
    std::string pattern;
    std::int64_t first = 1, last = 0, step = 1;
    in >> pattern >> first >> last >> step;
    source.files = files_of_pattern(path, pattern, first, last, in ? step : 1);
  } else {
    source.files = {beside(path, name)};
  }
  return source;
}

}  // namespace

RawImage read_metaimage(const std::string& path) {
  const Header header = read_header(path);
  if (const auto channels = numbers(path, header, {"ElementNumberOfChannels"}, 1);
      !channels.empty() && channels[0] != 1)
    fail(path, "has " + header.field({"ElementNumberOfChannels"}) +
                   " values a voxel (RGB or vectors); give an image with one label or grey value a voxel");
  const std::vector<std::int64_t> sizes = read_sizes(path, header);
  RawImage image;
  image.type = sample_type(path, header);
  set_geometry(path, header, sizes, image);
  open_samples(path, sample_source(path, header), sizes, image);
  return image;
}

}  // namespace treemarch
