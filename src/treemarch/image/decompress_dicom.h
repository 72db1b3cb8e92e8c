/// \file
/// Compressed DICOM slices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "treemarch/image/dicom_decoder.h"

namespace treemarch {

struct DicomPixels {
  DicomFormat format;
  std::unique_ptr<std::byte[]> samples;  ///< in this machine's byte order, not rescaled
};

/// Decompresses the pixels of a DICOM file of any transfer syntax that GDCM knows.
/// \param pixels that the file's header tells of
/// \throw Error(input) where they cannot be decompressed or are of another number; Error(limits) where memory or
/// processes are short
DicomPixels decompress_dicom(const std::string& path, std::int64_t pixels);

}  // namespace treemarch
