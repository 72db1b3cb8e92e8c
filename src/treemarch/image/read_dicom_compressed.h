/// \file
/// Compressed DICOM slices through ITK and GDCM: the one source file that sees ITK.
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads the samples of a DICOM file of any transfer syntax that GDCM decodes, rescaled as the file says; sets type and
/// data. \pre image.extent is set
/// \throw Error(input)
void read_dicom_compressed(const std::string& path, RawImage& image);

}  // namespace treemarch
