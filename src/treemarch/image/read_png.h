/// \file
/// PNG files through libpng. (ITK 5.2 stretches samples of less than 8 bits and so changes labels.)
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads a grey PNG file of 1 to 16 bits: 2D, without spacing. \throw Error(input)
RawImage read_png(const std::string& path);

}  // namespace treemarch
