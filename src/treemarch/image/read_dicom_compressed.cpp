#include "treemarch/image/read_dicom_compressed.h"

#include <gdcmTrace.h>
#include <itkGDCMImageIO.h>

#include <regex>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// One line of what ITK says, without class names and addresses.
std::string cleaned(const std::string& text) {
  std::string s = std::regex_replace(text, std::regex("\\s+"), " ");
  s = std::regex_replace(s, std::regex("(ITK ERROR|itk::ERROR): *\\w*(\\(0x[0-9a-f]+\\))?: *"), "");
  return s.size() > 200 ? s.substr(0, 200) + "..." : s;
}

SampleType sample_type(const std::string& path, const itk::ImageIOBase& io) {
  using Component = itk::IOComponentEnum;
  if (io.GetNumberOfComponents() == 1) switch (io.GetComponentType()) {
      case Component::UCHAR:
        return SampleType::u8;
      case Component::CHAR:
        return SampleType::i8;
      case Component::USHORT:
        return SampleType::u16;
      case Component::SHORT:
        return SampleType::i16;
      case Component::UINT:
        return SampleType::u32;
      case Component::INT:
        return SampleType::i32;
      case Component::FLOAT:
        return SampleType::f32;
      case Component::DOUBLE:
        return SampleType::f64;
      default:
        break;
    }
  fail(path, "has samples that cannot be read as labels or grey values; convert it to NIfTI or NRRD");
}

void read_by_itk(const std::string& path, RawImage& image) {
  const auto io = itk::GDCMImageIO::New();
  io->SetFileName(path);
  io->ReadImageInformation();
  image.type = sample_type(path, *io);
  const unsigned dims = io->GetNumberOfDimensions();
  itk::ImageIORegion region(dims);
  for (unsigned d = 0; d < dims; ++d) {
    if (static_cast<std::int64_t>(io->GetDimensions(d)) != (d < 3 ? image.extent[d] : 1))
      fail(path, "its compressed pixels have another size than its header says; get a complete copy");
    region.SetSize(d, io->GetDimensions(d));
  }
  io->SetIORegion(region);
  io->Read(image.allocate());
}

}  // namespace

void read_dicom_compressed(const std::string& path, RawImage& image) {
  itk::Object::GlobalWarningDisplayOff();
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();
  try {
    read_by_itk(path, image);
  } catch (const Error&) {
    throw;
  } catch (const itk::ExceptionObject& e) {
    fail(path, "cannot be decompressed (" + cleaned(e.GetDescription()) + "); get a complete copy or convert it");
  } catch (const std::exception& e) {
    fail(path, "cannot be decompressed (" + cleaned(e.what()) + "); get a complete copy or convert it");
  }
}

}  // namespace treemarch
