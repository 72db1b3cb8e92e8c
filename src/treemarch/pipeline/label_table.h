/// \file
/// Labels as users write them: by number or by name.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// Finds the materials that a text names.
///
/// LABEL is a number or a name. SET is a list of items separated by commas; an item is a LABEL or a range of numbers
/// `2-6`, both ends included, which takes those that exist.
class LabelTable {
 public:
  /// \param names empty, or as many as labels.
  LabelTable(const std::vector<std::int32_t>& labels, const std::vector<std::string>& names);

  /// \param option for the message.
  /// \throw Error(usage) if there is no such label.
  [[nodiscard]] MaterialId find(std::string_view label, std::string_view option) const;
  /// In the order of the ids, without repetition. \throw Error(usage) as find(), and for a range that holds no label.
  [[nodiscard]] std::vector<MaterialId> find_set(std::string_view set, std::string_view option) const;
  /// As find(), but kOutside where there is no such label.
  [[nodiscard]] MaterialId find_or_none(std::string_view label) const;

 private:
  std::vector<std::pair<std::int32_t, MaterialId>> by_value_;
  std::vector<std::pair<std::string, MaterialId>> by_name_;
};

/// The number that the whole of a text is. Returns false if it is none or does not fit.
bool parse_int32(std::string_view text, std::int32_t& value);
/// As parse_int32(), for a finite number.
bool parse_double(std::string_view text, double& value);

/// The parts of a text between separators; one empty part for an empty text.
std::vector<std::string_view> split(std::string_view text, char separator);

/// The parts before and after the last '='. \throw Error(usage) if there is none or a part is empty.
std::pair<std::string_view, std::string_view> split_assignment(std::string_view text, std::string_view option);

}  // namespace treemarch
