/// \file
/// MetaImage files (.mha, .mhd).
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads a MetaImage file, binary, compressed or ascii, attached or detached (one file, a list, a pattern). World:
/// "LPS" in mm; the rows of TransformMatrix are the directions of the axes, as ITK has it. A fourth axis holds volumes.
/// \throw Error(input)
RawImage read_metaimage(const std::string& path);

}  // namespace treemarch
