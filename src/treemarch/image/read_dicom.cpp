#include "treemarch/image/read_dicom.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>

#include "treemarch/core/error.h"
#include "treemarch/image/decompress_dicom.h"
#include "treemarch/image/dicom_elements.h"

namespace treemarch {
namespace {

using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::string millimetre_text(double v) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g mm", v);
  return text.data();
}

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

enum Tag : std::uint32_t {
  kSopClass = 0x00080016,
  kSliceThickness = 0x00180050,
  kSeries = 0x0020000e,
  kPosition = 0x00200032,
  kOrientation = 0x00200037,
  kSamplesPerPixel = 0x00280002,
  kPhotometric = 0x00280004,
  kFrames = 0x00280008,
  kRows = 0x00280010,
  kColumns = 0x00280011,
  kPixelSpacing = 0x00280030,
  kBitsAllocated = 0x00280100,
  kBitsStored = 0x00280101,
  kHighBit = 0x00280102,
  kSigned = 0x00280103,
  kIntercept = 0x00281052,
  kSlope = 0x00281053,
  kPixelData = 0x7fe00010,
};

struct Slice {
  std::string path;
  std::string series;
  RawImage image;
  double along = 0;  ///< position along the normal of the first slice
};

/// Refuses what is no plain slice of labels or grey values.
void check_kind(const std::string& path, const DicomElements& dicom) {
  if (dicom.text(kSopClass) == "1.2.840.10008.5.1.4.1.1.66.4")
    fail(path, "is a DICOM segmentation object, which is not read; convert it to NIfTI or NRRD");
  if (const std::string frames = dicom.text(kFrames); !frames.empty() && frames != "1")
    fail(path, "has several frames in one DICOM file, which is not read; convert it to NIfTI or NRRD");
  const std::string photometric = dicom.text(kPhotometric);
  if (photometric.starts_with("PALETTE"))
    fail(path, "is a palette picture, whose colours need not be labels; convert it to grey values");
  if (dicom.number(kSamplesPerPixel).value_or(1) != 1 || !photometric.starts_with("MONOCHROME"))
    fail(path, "is a colour (RGB) picture; give an image with one label or grey value a pixel");
}

void set_geometry(const DicomElements& dicom, RawImage& image) {
  image.space = "LPS";
  const std::vector<double> position = dicom.decimals(kPosition), orientation = dicom.decimals(kOrientation);
  const std::vector<double> spacing = dicom.decimals(kPixelSpacing), thickness = dicom.decimals(kSliceThickness);
  if (position.size() == 3) std::copy(position.begin(), position.end(), image.origin.begin());
  if (orientation.size() == 6)
    for (std::size_t r = 0; r < 3; ++r) {
      image.axis[0][r] = orientation[r];
      image.axis[1][r] = orientation[r + 3];
    }
  image.axis[2] = cross(image.axis[0], image.axis[1]);
  image.has_spacing = spacing.size() == 2;
  for (std::size_t r = 0; r < 3; ++r) {
    // The first number is the distance between rows, thus along the second axis.
    if (spacing.size() == 2) {
      image.axis[0][r] *= spacing[1];
      image.axis[1][r] *= spacing[0];
    }
    if (thickness.size() == 1 && thickness[0] > 0) image.axis[2][r] *= thickness[0];
  }
}

SampleType sample_type(const std::string& path, const DicomFormat& format) {
  const auto [bits, stored, high_bit, is_signed] = format;
  if ((bits != 8 && bits != 16 && bits != 32) || stored < 1 || stored > bits || high_bit != stored - 1)
    fail(path, "has " + std::to_string(stored) + " of " + std::to_string(bits) +
                   " bits a sample in a way that is not read; convert it to NIfTI or NRRD");
  if (bits == 8) return is_signed ? SampleType::i8 : SampleType::u8;
  if (bits == 16) return is_signed ? SampleType::i16 : SampleType::u16;
  return is_signed ? SampleType::i32 : SampleType::u32;
}

/// Sets the bits above those that are stored to what the value needs; they may hold anything.
template <class T>
void clean_high_bits(unsigned stored, std::byte* data, std::size_t count) {
  const unsigned unused = 8 * sizeof(T) - stored;
  for (std::size_t i = 0; i < count; ++i) {
    std::make_unsigned_t<T> bits;
    std::memcpy(&bits, data + i * sizeof(T), sizeof(T));
    bits = static_cast<std::make_unsigned_t<T>>(bits << unused);
    const auto value = static_cast<T>(static_cast<T>(bits) >> unused);  // arithmetic for signed types
    std::memcpy(data + i * sizeof(T), &value, sizeof(T));
  }
}

/// Takes over samples of the image's type, of which so many bits are stored.
void set_samples(const std::byte* from, unsigned stored, bool swap, RawImage& image) {
  const auto count = static_cast<std::size_t>(image.voxels());
  const std::size_t bytes = sample_bytes(image.type);
  std::byte* const data = image.allocate();
  std::memcpy(data, from, image.bytes());
  if (swap) swap_bytes(data, count, bytes);
  if (stored < 8 * bytes)
    visit_type(image.type, [&]<class T>(T) {
      if constexpr (std::is_integral_v<T>) clean_high_bits<T>(stored, data, count);
    });
}

/// Samples that stand in the file as they are.
void read_plain_samples(const std::string& path, const DicomElements& dicom, RawImage& image) {
  DicomFormat format;
  format.bits = dicom.number(kBitsAllocated).value_or(0);
  format.stored = dicom.number(kBitsStored).value_or(format.bits);
  format.is_signed = dicom.number(kSigned).value_or(0) == 1;
  format.high_bit = dicom.number(kHighBit).value_or(format.stored - 1);
  image.type = sample_type(path, format);
  const DicomElements::Element& pixels = *dicom.find(kPixelData);
  check_size(path, std::span(image.extent).first(2), sample_bytes(image.type), static_cast<std::int64_t>(pixels.length),
             1);
  if (image.bytes() > pixels.length) fail(path, "its pixel data are cut short; get a complete copy");
  set_samples(reinterpret_cast<const std::byte*>(dicom.bytes.data()) + pixels.offset, format.stored, dicom.big_endian,
              image);
}

void read_compressed_samples(const std::string& path, RawImage& image) {
  const DicomPixels pixels = decompress_dicom(path, image.voxels());
  image.type = sample_type(path, pixels.format);
  set_samples(pixels.samples.get(), pixels.format.stored, false, image);
}

Slice read_slice(const std::string& path) {
  const DicomElements dicom = read_dicom_elements(path);
  check_kind(path, dicom);
  Slice slice;
  slice.path = path;
  slice.series = dicom.text(kSeries);
  RawImage& image = slice.image;
  image.extent = {dicom.number(kColumns).value_or(0), dicom.number(kRows).value_or(0), 1};
  check_size(path, std::span(image.extent).first(2), 1, -1, 1);
  set_geometry(dicom, image);
  if (dicom.compressed)
    read_compressed_samples(path, image);
  else
    read_plain_samples(path, dicom, image);
  if (const std::vector<double> slope = dicom.decimals(kSlope), intercept = dicom.decimals(kIntercept);
      slope.size() == 1 && intercept.size() == 1) {
    image.slope = slope[0];
    image.intercept = intercept[0];
  }
  return slice;
}

void check_one_series(const std::string& path, const std::vector<Slice>& slices) {
  std::map<std::string, std::size_t> count;
  for (const Slice& s : slices) ++count[s.series];
  if (count.size() == 1) return;
  std::string list;
  std::size_t listed = 0;
  for (const auto& [series, n] : count) {
    if (++listed > 5) {
      list += ", ...";
      break;
    }
    list += (list.empty() ? "" : ", ") + series + " (" + std::to_string(n) + (n == 1 ? " file)" : " files)");
  }
  fail(path, "holds " + std::to_string(count.size()) + " DICOM series: " + list +
                 "; put the files of one series into a folder of their own");
}

/// Sorts the slices along their normal and checks that they make a regular grid; returns the step between them.
Vector sort_slices(const std::string& path, std::vector<Slice>& slices) {
  const RawImage& first = slices[0].image;
  const Vector& x = first.axis[0];
  const Vector& y = first.axis[1];
  const Vector normal = cross(x, y);
  const double length = std::sqrt(dot(normal, normal));
  if (!(length > 0)) fail(slices[0].path, "its image orientation or pixel spacing cannot be; repair the file");
  for (Slice& s : slices) {
    for (std::size_t c = 0; c < 2; ++c)
      for (std::size_t r = 0; r < 3; ++r)
        if (!(std::abs(s.image.axis[c][r] - first.axis[c][r]) <= 1e-3 * std::sqrt(length)))
          fail(s.path, "has another orientation or pixel spacing than " + slices[0].path +
                           "; put slices of one kind into a folder of their own");
    s.along = dot(s.image.origin, normal) / length;
  }
  std::sort(slices.begin(), slices.end(),
            [](const Slice& a, const Slice& b) { return a.along != b.along ? a.along < b.along : a.path < b.path; });

  std::vector<double> gaps;
  for (std::size_t s = 1; s < slices.size(); ++s) gaps.push_back(slices[s].along - slices[s - 1].along);
  std::vector<double> sorted = gaps;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double usual = sorted[sorted.size() / 2];
  for (std::size_t s = 0; s < gaps.size(); ++s) {
    if (!(gaps[s] > 1e-4))
      fail(path, "the slices " + slices[s].path + " and " + slices[s + 1].path +
                     " lie at the same place; remove one, or split the series");
    if (std::abs(gaps[s] - usual) > 0.01 * usual)
      fail(path, "slices are missing or unevenly spaced: " + millimetre_text(gaps[s]) + " from " + slices[s].path +
                     " to the next, " + millimetre_text(usual) + " elsewhere; complete or resample the series");
  }
  Vector step{};
  for (std::size_t r = 0; r < 3; ++r)
    step[r] = (slices.back().image.origin[r] - slices.front().image.origin[r]) / static_cast<double>(gaps.size());
  return step;
}

std::vector<std::string> dicom_files(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename() != "DICOMDIR" && is_dicom_file(entry.path().string()))
      files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

bool is_dicom_file(const std::string& path) {
  std::array<char, 132> start{};
  std::size_t got = 0;
  if (std::FILE* f = std::fopen(path.c_str(), "rb")) {
    got = std::fread(start.data(), 1, start.size(), f);
    std::fclose(f);
  }
  return got == start.size() && std::equal(start.begin() + 128, start.end(), "DICM");
}

RawImage read_dicom(const std::string& path, const Execution& execution) {
  if (!std::filesystem::is_directory(path)) return std::move(read_slice(path).image);
  std::vector<Slice> slices;
  for (const std::string& file : dicom_files(path)) {
    execution.check();
    slices.push_back(read_slice(file));
  }
  if (slices.empty()) fail(path, "holds no DICOM file; check the folder");
  check_one_series(path, slices);
  if (slices.size() == 1) return std::move(slices[0].image);
  const Vector step = sort_slices(path, slices);
  std::vector<RawImage> images;
  std::vector<std::string> paths;
  for (Slice& s : slices) {
    images.push_back(std::move(s.image));
    paths.push_back(s.path);
  }
  RawImage stack = stack_slices(std::move(images), paths);
  stack.axis[2] = step;
  return stack;
}

}  // namespace treemarch
