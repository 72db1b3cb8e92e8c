#include "treemarch/image/read_dicom.h"

#include <gdcmTrace.h>
#include <itkGDCMImageIO.h>
#include <itkMetaDataObject.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

#include "treemarch/core/error.h"
#include "treemarch/image/itk_support.h"

namespace treemarch {
namespace {

using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

std::string millimetre_text(double v) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g mm", v);
  return text.data();
}

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

struct Slice {
  std::string path;
  std::string series;
  Vector position{};
  RawImage image;
  double along = 0;  ///< position along the normal of the first slice
};

std::string text_of(const itk::GDCMImageIO& io, const std::string& tag) {
  std::string value;
  itk::ExposeMetaData(io.GetMetaDataDictionary(), tag, value);
  while (!value.empty() && (value.back() == ' ' || value.back() == '\0')) value.pop_back();
  return value;
}

/// Reads one file; its axis[2] becomes the normal times the thickness that the file gives.
Slice read_slice(const std::string& path) {
  Slice slice;
  slice.path = path;
  guard_itk(path, [&] {
    gdcm::Trace::DebugOff();
    gdcm::Trace::WarningOff();
    gdcm::Trace::ErrorOff();
    const auto io = itk::GDCMImageIO::New();
    io->SetFileName(path);
    io->ReadImageInformation();
    if (text_of(*io, "0008|0016") == "1.2.840.10008.5.1.4.1.1.66.4")
      fail(path, "is a DICOM segmentation object, which is not read; convert it to NIfTI or NRRD");
    slice.series = text_of(*io, "0020|000e");
    RawImage& image = slice.image;
    image.type = itk_sample_type(path, *io);
    image.space = "LPS";
    std::vector<std::int64_t> sizes;
    for (unsigned c = 0; c < std::min(io->GetNumberOfDimensions(), 3U); ++c) {
      image.extent[c] = static_cast<std::int64_t>(io->GetDimensions(c));
      sizes.push_back(image.extent[c]);
      image.origin[c] = io->GetOrigin(c);
      const std::vector<double> direction = io->GetDirection(c);
      for (unsigned r = 0; r < 3 && r < direction.size(); ++r) image.axis[c][r] = direction[r] * io->GetSpacing(c);
    }
    slice.position = image.origin;
    // Compressed transfer syntaxes may shrink further than deflate does.
    check_size(path, sizes, sample_bytes(image.type), static_cast<std::int64_t>(std::filesystem::file_size(path)), 1e5);
    image.allocate(path);
    read_itk_samples(*io, image.data.get());
  });
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
  const Vector cross{x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
  const double length = std::sqrt(dot(cross, cross));
  if (!(length > 0)) fail(slices[0].path, "its image orientation or pixel spacing cannot be; repair the file");
  for (Slice& s : slices) {
    for (std::size_t c = 0; c < 2; ++c)
      for (std::size_t r = 0; r < 3; ++r)
        if (!(std::abs(s.image.axis[c][r] - first.axis[c][r]) <= 1e-3 * std::sqrt(length)))
          fail(s.path, "has another orientation or pixel spacing than " + slices[0].path +
                           "; put slices of one kind into a folder of their own");
    s.along = dot(s.position, cross) / length;
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
    step[r] = (slices.back().position[r] - slices.front().position[r]) / static_cast<double>(gaps.size());
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
    if (s.image.extent[2] != 1) fail(s.path, "has several frames beside other files; give this file alone");
    images.push_back(std::move(s.image));
    paths.push_back(s.path);
  }
  RawImage stack = stack_slices(std::move(images), paths);
  stack.axis[2] = step;
  return stack;
}

}  // namespace treemarch
