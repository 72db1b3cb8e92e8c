#include "treemarch/pipeline/length.h"

#include <string>

#include "treemarch/core/error.h"
#include "treemarch/pipeline/label_table.h"

namespace treemarch {

double parse_length(std::string_view text, double smallest_spacing, std::string_view option) {
  const struct {
    std::string_view suffix;
    double millimetres;
  } units[] = {
      {"vox", smallest_spacing}, {"mm", 1}, {"um", 1e-3}, {"\u00b5m", 1e-3}, {"nm", 1e-6}, {"cm", 10}, {"m", 1000}};
  double scale = 1;
  std::string_view number = text;
  for (const auto& unit : units) {
    if (text.ends_with(unit.suffix)) {
      number.remove_suffix(unit.suffix.size());
      scale = unit.millimetres;
      break;
    }
  }
  double value = 0;
  if (!parse_double(number, value)) {
    throw Error(ErrorKind::usage,
                std::string(option) + ": '" + std::string(text) + "' is no length; write 2mm, 2um, 2vox or 2");
  }
  if (!(value > 0))
    throw Error(ErrorKind::usage, std::string(option) + ": '" + std::string(text) + "' is not greater than zero");
  return value * scale;
}

}  // namespace treemarch
