/// \file
/// NIfTI-1 and NIfTI-2 files (.nii, .nii.gz, .hdr with .img), through libnifti.
#pragma once

#include <string>

#include "treemarch/core/execution.h"
#include "treemarch/image/raw_image.h"

namespace treemarch {

/// Reads all volumes of a NIfTI file. World: "RAS" in mm; sform before qform (a warning where both are set and differ
/// by more than a tenth of a voxel anywhere); with neither the spacing alone, voxel 0 at the origin (a warning). \throw
/// Error(input)
RawImage read_nifti(const std::string& path, const Execution& execution);

}  // namespace treemarch
