/// \file
/// MetaImage files (.mha, .mhd) through ITK.
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads a MetaImage file. World: "LPS" in mm. A fourth axis holds volumes. \throw Error(input)
RawImage read_metaimage(const std::string& path);

}  // namespace treemarch
