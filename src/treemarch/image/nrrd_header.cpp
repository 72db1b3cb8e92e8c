#include "treemarch/image/nrrd_header.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <limits>
#include <sstream>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// No header is longer than this; what is, is not a header.
constexpr std::size_t kLongestHeader = std::size_t{1} << 24;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

std::string trimmed(const std::string& s) {
  const auto begin = s.find_first_not_of(" \t\r");
  if (begin == std::string::npos) return {};
  return s.substr(begin, s.find_last_not_of(" \t\r") - begin + 1);
}

std::string lower(std::string s) {
  std::transform(s.begin(), s.end(), s.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return s;
}

std::vector<std::string> words(const std::string& s) {
  std::istringstream in(s);
  std::vector<std::string> result;
  for (std::string word; in >> word;) result.push_back(word);
  return result;
}

double number(const std::string& path, const std::string& field, const std::string& text) {
  if (lower(text) == "nan") return std::numeric_limits<double>::quiet_NaN();
  double value = 0;
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  const auto [end, failed] = std::from_chars(begin, text.data() + text.size(), value);
  if (failed != std::errc{} || end != text.data() + text.size())
    fail(path, "its field '" + field + "' has '" + text + "' where a number should be; repair the header");
  return value;
}

/// "(a,b,c)" -> numbers.
std::vector<double> vector_value(const std::string& path, const std::string& field, const std::string& text) {
  std::vector<double> result;
  std::istringstream in(text.substr(1, text.size() - 2));
  for (std::string part; std::getline(in, part, ',');) result.push_back(number(path, field, trimmed(part)));
  return result;
}

/// The vectors of a field: "(a,b,c)" or "none", with any blanks; "none" gives an empty vector.
std::vector<std::vector<double>> vectors(const std::string& path, const std::string& field, const std::string& text) {
  std::vector<std::vector<double>> result;
  for (std::size_t at = text.find_first_not_of(" \t"); at != std::string::npos;
       at = text.find_first_not_of(" \t", at)) {
    if (text[at] == '(') {
      const std::size_t end = text.find(')', at);
      if (end == std::string::npos) fail(path, "its field '" + field + "' lacks a ')'; repair the header");
      result.push_back(vector_value(path, field, text.substr(at, end - at + 1)));
      at = end + 1;
    } else {
      const std::size_t end = std::min(text.find_first_of(" \t(", at), text.size());
      if (lower(text.substr(at, end - at)) != "none")
        fail(path, "its field '" + field + "' is not a list of vectors; repair the header");
      result.emplace_back();
      at = end;
    }
  }
  return result;
}

/// The strings in quotes of a field.
std::vector<std::string> quoted(const std::string& text) {
  std::vector<std::string> result;
  for (std::size_t at = text.find('"'); at != std::string::npos; at = text.find('"', at)) {
    const std::size_t end = text.find('"', at + 1);
    if (end == std::string::npos) break;
    result.push_back(text.substr(at + 1, end - at - 1));
    at = end + 1;
  }
  return result;
}

/// Millimetres a unit; 1 for those not known.
double millimetres(const std::string& unit) {
  const std::string u = lower(unit);
  if (u == "m" || u == "meter" || u == "metre" || u == "meters" || u == "metres") return 1000;
  if (u == "cm" || u == "centimeter" || u == "centimetre") return 10;
  if (u == "um" || u == "micron" || u == "microns" || u == "micrometer" || u == "micrometre" || unit == "\xc2\xb5m" ||
      unit == "\xce\xbcm" || unit == "\xb5m")
    return 1e-3;
  if (u == "nm" || u == "nanometer" || u == "nanometre") return 1e-6;
  return 1;
}

std::string space_letters(const std::string& text) {
  std::string s = lower(text);
  if (s.ends_with("-time")) s.resize(s.size() - 5);
  if (s == "right-anterior-superior" || s == "ras" || s == "rast") return "RAS";
  if (s == "left-anterior-superior" || s == "las" || s == "last") return "LAS";
  if (s == "left-posterior-superior" || s == "lps" || s == "lpst") return "LPS";
  return {};
}

void set_sizes(const std::string& path, const NrrdHeader& header, NrrdGeometry& geometry) {
  const std::vector<std::string> sizes = words(header.field("sizes"));
  if (sizes.empty()) fail(path, "its header has no 'sizes'; the file is damaged or is not a NRRD image");
  if (sizes.size() > 16 || header.field("dimension") != std::to_string(sizes.size()))
    fail(path, "its 'dimension' and 'sizes' disagree; repair the header");
  for (const std::string& text : sizes) {
    NrrdAxis axis;
    const double size = number(path, "sizes", text);
    axis.size = size >= 1 && size <= 9e15 ? static_cast<std::int64_t>(size) : 0;
    geometry.axes.push_back(axis);
  }
}

}  // namespace

const std::string& NrrdHeader::field(const std::string& name) const {
  static const std::string none;
  const auto found = std::find_if(fields.begin(), fields.end(), [&](const auto& f) { return f.first == name; });
  return found == fields.end() ? none : found->second;
}

NrrdHeader read_nrrd_header(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  NrrdHeader header;
  std::string line;
  if (!std::getline(in, line) || !line.starts_with("NRRD")) fail(path, "is not a NRRD file; check the name");
  header.bytes = line.size() + 1;
  while (std::getline(in, line)) {
    header.bytes += line.size() + 1;
    if (header.bytes > kLongestHeader) fail(path, "its header does not end; the file is damaged");
    line = trimmed(line);
    if (line.empty()) break;
    if (line.starts_with('#')) continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    const bool key = line.compare(colon, 2, ":=") == 0;
    if (key)
      header.keys.emplace_back(line.substr(0, colon), line.substr(colon + 2));
    else
      header.fields.emplace_back(lower(trimmed(line.substr(0, colon))), trimmed(line.substr(colon + 1)));
  }
  return header;
}

NrrdGeometry nrrd_geometry(const std::string& path, const NrrdHeader& header) {
  NrrdGeometry geometry;
  set_sizes(path, header, geometry);
  auto& axes = geometry.axes;
  const auto each_axis = [&](std::size_t count, const char* field) {
    if (count != axes.size())
      fail(path, "its field '" + std::string(field) + "' does not fit 'sizes'; repair the header");
  };

  if (const std::string& kinds = header.field("kinds"); !kinds.empty()) {
    const std::vector<std::string> kind = words(kinds);
    each_axis(kind.size(), "kinds");
    for (std::size_t a = 0; a < axes.size(); ++a)
      if (kind[a] != "none" && kind[a] != "???") axes[a].kind = lower(kind[a]);
  }
  if (const std::string& spacings = header.field("spacings"); !spacings.empty()) {
    const std::vector<std::string> spacing = words(spacings);
    const std::vector<std::string> unit = quoted(header.field("units"));
    each_axis(spacing.size(), "spacings");
    for (std::size_t a = 0; a < axes.size(); ++a) {
      axes[a].has_spacing = true;
      axes[a].spacing = number(path, "spacings", spacing[a]) * (a < unit.size() ? millimetres(unit[a]) : 1);
    }
  }
  geometry.space = space_letters(header.field("space"));
  // Units belong to the axes of the world, so they scale the components of every vector.
  const std::vector<std::string> unit = quoted(header.field("space units"));
  const auto scale = [&](std::vector<double>& v) {
    for (std::size_t r = 0; r < v.size() && r < unit.size(); ++r) v[r] *= millimetres(unit[r]);
  };
  if (const std::string& text = header.field("space directions"); !text.empty()) {
    auto directions = vectors(path, "space directions", text);
    each_axis(directions.size(), "space directions");
    geometry.has_directions = true;
    for (std::size_t a = 0; a < axes.size(); ++a) {
      scale(directions[a]);
      axes[a].direction = std::move(directions[a]);
    }
  }
  if (const std::string& text = header.field("space origin"); !text.empty()) {
    auto origins = vectors(path, "space origin", text);
    if (origins.size() != 1) fail(path, "its field 'space origin' is not one vector; repair the header");
    scale(origins[0]);
    geometry.origin = std::move(origins[0]);
  }
  return geometry;
}

std::vector<std::pair<std::int32_t, std::string>> nrrd_segment_names(const NrrdHeader& header) {
  const auto value_of = [&](const std::string& key) -> const std::string* {
    const auto found =
        std::find_if(header.keys.begin(), header.keys.end(), [&](const auto& k) { return k.first == key; });
    return found == header.keys.end() ? nullptr : &found->second;
  };
  std::vector<std::pair<std::int32_t, std::string>> names;
  for (const auto& [key, name] : header.keys) {
    if (!key.starts_with("Segment") || !key.ends_with("_Name")) continue;
    const std::string* text = value_of(key.substr(0, key.size() - 4) + "LabelValue");
    std::int32_t label = 0;
    if (text && std::from_chars(text->data(), text->data() + text->size(), label).ec == std::errc{})
      names.emplace_back(label, name);
  }
  return names;
}

}  // namespace treemarch
