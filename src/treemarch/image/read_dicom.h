/// \file
/// DICOM series. Plain samples are read here, compressed ones through ITK and GDCM: Debian's GDCM is built with
/// assertions and ends the program on damaged files.
#pragma once

#include <string>

#include "treemarch/core/execution.h"
#include "treemarch/image/raw_image.h"

namespace treemarch {

/// True if the file is DICOM ("DICM" after the preamble).
bool is_dicom_file(const std::string& path);

/// Reads the one DICOM series of a folder, or a single file. World: "LPS" in mm. Slices are sorted along their normal
/// by their position; a gantry tilt gives a sheared frame. Rescale slope and intercept are applied. \throw Error(input)
/// for several series, missing or unevenly spaced slices, slices that differ in size or direction.
RawImage read_dicom(const std::string& path, const Execution& execution);

}  // namespace treemarch
