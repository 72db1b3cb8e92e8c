// The module treemarch_dicom: the one source file that sees GDCM. It is loaded when a compressed file is to be read, as
// GDCM takes longer to start than all else together.
#include "treemarch/image/dicom_decoder.h"

#include <gdcmImageReader.h>

extern "C" treemarch::DecodeDicom treemarch_decode_dicom;

bool treemarch_decode_dicom(const char* path, std::size_t room, treemarch::DecodedDicom& header, std::byte* samples) {
  try {
    gdcm::ImageReader reader;
    reader.SetFileName(path);
    if (!reader.Read()) return false;
    const gdcm::Image& image = reader.GetImage();
    const gdcm::PixelFormat& format = image.GetPixelFormat();
    header.format = {format.GetBitsAllocated(), format.GetBitsStored(), format.GetHighBit(),
                     format.GetPixelRepresentation() == 1};
    header.bytes = image.GetBufferLength();
    return header.bytes <= room && image.GetBuffer(reinterpret_cast<char*>(samples));
  } catch (...) {
    return false;
  }
}
