/// \file
/// The text header of a NRRD file: what ITK does not hand on unchanged (space, sheared directions, units, names).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace treemarch {

struct NrrdHeader {
  std::vector<std::pair<std::string, std::string>> fields;  ///< "name: value", names in lower case, in file order
  std::vector<std::pair<std::string, std::string>> keys;    ///< "key:=value"
  std::size_t bytes = 0;                                    ///< length of the header with the empty line that ends it

  /// Value of a field, empty where it is absent.
  [[nodiscard]] const std::string& field(const std::string& name) const;
};

/// One axis of the array.
struct NrrdAxis {
  std::int64_t size = 0;
  std::string kind;               ///< "domain", "list", ... or empty
  std::vector<double> direction;  ///< empty where "none" or not given; in mm where the unit is known
  bool has_spacing = false;       ///< `spacings` is given
  double spacing = 1;             ///< from `spacings`; in mm where the unit is known
};

/// The geometry that a header declares.
struct NrrdGeometry {
  std::vector<NrrdAxis> axes;
  std::vector<double> origin;   ///< in mm where the unit is known; empty where not given
  std::string space;            ///< as Frame::space ("RAS", "LAS", "LPS") or empty
  bool has_directions = false;  ///< `space directions` is given
};

/// Splits the header of a file into its fields. \throw Error(input)
NrrdHeader read_nrrd_header(const std::string& path);

/// Interprets the fields of axes and space. \throw Error(input)
NrrdGeometry nrrd_geometry(const std::string& path, const NrrdHeader& header);

/// Names of labels as 3D Slicer writes them (Segment0_LabelValue, Segment0_Name).
std::vector<std::pair<std::int32_t, std::string>> nrrd_segment_names(const NrrdHeader& header);

}  // namespace treemarch
