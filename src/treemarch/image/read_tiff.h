/// \file
/// TIFF files through libtiff. (ITK 5.2 gives zeros for 32-bit integers and refuses 64 bit and tiles.)
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads a TIFF file: 2D, or 3D if it has several pages. Any integer or floating-point type, strips or tiles. It
/// carries no spacing (resolution tags speak of print). \throw Error(input)
RawImage read_tiff(const std::string& path);

}  // namespace treemarch
