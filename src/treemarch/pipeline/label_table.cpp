#include "treemarch/pipeline/label_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// A range of numbers `a-b`; either may be negative.
bool parse_range(std::string_view text, std::int32_t& first, std::int32_t& last) {
  const std::size_t dash = text.find('-', 1);
  return dash != std::string_view::npos && parse_int32(text.substr(0, dash), first) &&
         parse_int32(text.substr(dash + 1), last) && first <= last;
}

}  // namespace

LabelTable::LabelTable(const std::vector<std::int32_t>& labels, const std::vector<std::string>& names) {
  for (std::size_t m = 0; m < labels.size(); ++m) {
    by_value_.emplace_back(labels[m], static_cast<MaterialId>(m));
    if (!names.empty() && !names[m].empty()) by_name_.emplace_back(names[m], static_cast<MaterialId>(m));
  }
  std::ranges::sort(by_value_);
  std::ranges::sort(by_name_);
}

MaterialId LabelTable::find_or_none(std::string_view label) const {
  const auto named =
      std::ranges::lower_bound(by_name_, label, {}, [](const auto& e) -> std::string_view { return e.first; });
  if (named != by_name_.end() && named->first == label) return named->second;
  std::int32_t value = 0;
  if (!parse_int32(label, value)) return kOutside;
  const auto at = std::ranges::lower_bound(by_value_, value, {}, [](const auto& e) { return e.first; });
  return at != by_value_.end() && at->first == value ? at->second : kOutside;
}

MaterialId LabelTable::find(std::string_view label, std::string_view option) const {
  const MaterialId m = find_or_none(label);
  if (m == kOutside) {
    throw Error(ErrorKind::usage, std::string(option) + ": the image has no label '" + std::string(label) +
                                      "'; `treemarch info` lists its labels");
  }
  return m;
}

std::vector<MaterialId> LabelTable::find_set(std::string_view set, std::string_view option) const {
  std::vector<MaterialId> found;
  for (const std::string_view item : split(set, ',')) {
    std::int32_t first = 0, last = 0;
    if (find_or_none(item) != kOutside || !parse_range(item, first, last)) {
      found.push_back(find(item, option));
      continue;
    }
    const std::size_t before = found.size();
    for (const auto& [value, material] : by_value_)
      if (first <= value && value <= last) found.push_back(material);
    if (found.size() == before) {
      throw Error(ErrorKind::usage, std::string(option) + ": the image has no label in '" + std::string(item) +
                                        "'; `treemarch info` lists its labels");
    }
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool parse_int32(std::string_view text, std::int32_t& value) {
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  return status == std::errc() && end == text.data() + text.size();
}

bool parse_double(std::string_view text, double& value) {
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  return status == std::errc() && end == text.data() + text.size() && std::isfinite(value);
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

std::pair<std::string_view, std::string_view> split_assignment(std::string_view text, std::string_view option) {
  const std::size_t at = text.rfind('=');
  if (at == std::string_view::npos || at == 0 || at + 1 == text.size()) {
    throw Error(ErrorKind::usage, std::string(option) + ": '" + std::string(text) + "' is not of the form NAME=VALUE");
  }
  return {text.substr(0, at), text.substr(at + 1)};
}

}  // namespace treemarch
