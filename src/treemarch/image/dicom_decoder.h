/// \file
/// What lies between the library and the module that decodes compressed DICOM pixels (dicom_decoder.cpp).
#pragma once

#include <cstddef>

namespace treemarch {

/// How the samples of a DICOM file are stored.
struct DicomFormat {
  unsigned bits = 0;      ///< of a sample
  unsigned stored = 0;    ///< those of them that count
  unsigned high_bit = 0;  ///< the last of these
  bool is_signed = false;
};

struct DecodedDicom {
  DicomFormat format;
  std::size_t bytes = 0;  ///< of all samples
};

/// Name and type of the module's function, which writes up to `room` bytes of samples, in this machine's byte order and
/// not rescaled, and tells whether these are all and complete.
inline constexpr const char* kDecodeDicom = "treemarch_decode_dicom";
using DecodeDicom = bool(const char* path, std::size_t room, DecodedDicom& header, std::byte* samples);

}  // namespace treemarch
