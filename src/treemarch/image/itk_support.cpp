#include "treemarch/image/itk_support.h"

#include <new>
#include <regex>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// One line of what ITK says, without class names and addresses.
std::string cleaned(const std::string& text) {
  std::string s = std::regex_replace(text, std::regex("\\s+"), " ");
  s = std::regex_replace(s, std::regex("(ITK ERROR|itk::ERROR): *\\w*(\\(0x[0-9a-f]+\\))?: *"), "");
  return s.size() > 200 ? s.substr(0, 200) + "..." : s;
}

}  // namespace

void guard_itk(const std::string& path, const std::function<void()>& work) {
  itk::Object::GlobalWarningDisplayOff();
  try {
    work();
  } catch (const itk::ExceptionObject& e) {
    throw Error(ErrorKind::input, path + ": cannot be read (" + cleaned(e.GetDescription()) +
                                      "); the file is damaged, cut short or of an unsupported kind");
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::limits, path + ": too large for the memory of this machine; crop or downsample it");
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    throw Error(ErrorKind::input, path + ": cannot be read (" + cleaned(e.what()) + "); get a complete copy");
  }
}

SampleType itk_sample_type(const std::string& path, const itk::ImageIOBase& io) {
  using Component = itk::IOComponentEnum;
  using Pixel = itk::IOPixelEnum;
  if (io.GetPixelType() == Pixel::RGB || io.GetPixelType() == Pixel::RGBA)
    throw Error(ErrorKind::input,
                path + ": is a colour (RGB) image; give an image with one label or grey value a voxel");
  if (io.GetNumberOfComponents() != 1)
    throw Error(ErrorKind::input, path + ": has " + std::to_string(io.GetNumberOfComponents()) +
                                      " values a voxel; give an image with one label or grey value a voxel");
  switch (io.GetComponentType()) {
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
    case Component::ULONG:
      return sizeof(unsigned long) == 8 ? SampleType::u64 : SampleType::u32;
    case Component::LONG:
      return sizeof(long) == 8 ? SampleType::i64 : SampleType::i32;
    case Component::ULONGLONG:
      return SampleType::u64;
    case Component::LONGLONG:
      return SampleType::i64;
    case Component::FLOAT:
      return SampleType::f32;
    case Component::DOUBLE:
      return SampleType::f64;
    default:
      break;
  }
  throw Error(ErrorKind::input,
              path + ": has a sample type that cannot be read; convert it to an integer type or to float");
}

void read_itk_samples(itk::ImageIOBase& io, void* out) {
  const unsigned dims = io.GetNumberOfDimensions();
  itk::ImageIORegion region(dims);
  for (unsigned d = 0; d < dims; ++d) {
    region.SetIndex(d, 0);
    region.SetSize(d, io.GetDimensions(d));
  }
  io.SetIORegion(region);
  io.Read(out);
}

}  // namespace treemarch
