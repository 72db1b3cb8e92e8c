/// \file
/// NRRD files (.nrrd, .nhdr).
#pragma once

#include <string>

#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads a NRRD file, raw, gzip or ascii, attached or detached (one file, a list, a pattern). The world is the space
/// that the file declares, in mm where it gives units; sheared directions are kept. An axis of kind time or list that
/// comes last, or of kind list that comes first (segmentations in layers), holds volumes. \throw Error(input)
RawImage read_nrrd(const std::string& path);

}  // namespace treemarch
