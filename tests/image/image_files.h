/// \file
/// Image files made byte by byte, so that readers are tested against the formats and not against their own libraries.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/image/read_image.h"

namespace treemarch::testing {

using Bytes = std::string;

/// A folder that is removed with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] std::string path(const std::string& name = "") const;
  /// Writes a file and returns its path.
  std::string write(const std::string& name, const Bytes& content) const;

 private:
  std::filesystem::path folder_;
};

/// The bytes of a number, the other way round if `big_endian`.
template <class T>
Bytes bytes_of(T value, bool big_endian = false) {
  Bytes b(reinterpret_cast<const char*>(&value), sizeof value);
  return big_endian ? Bytes(b.rbegin(), b.rend()) : b;
}

template <class T>
Bytes bytes_of_all(const std::vector<T>& values, bool big_endian = false) {
  Bytes b;
  for (const T v : values) b += bytes_of(v, big_endian);
  return b;
}

/// The element types that images may have.
using SampleTypes = ::testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t,
                                     std::uint32_t, std::int64_t, std::uint64_t, float, double>;

/// Values of n voxels, which repeat.
template <class T>
std::vector<T> counted(std::size_t n) {
  std::vector<T> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<T>(i % 7);
  return values;
}

/// Puts in a few that show whether a reader cuts off bits of the type. \pre six values at least
template <class T>
std::vector<T> with_wide_values(std::vector<T> values) {
  if (std::numeric_limits<T>::is_signed) values[3] = static_cast<T>(-1);
  if (sizeof(T) >= 4) values[4] = static_cast<T>(70000);
  if (sizeof(T) >= 4 && !std::is_same_v<T, float>) values[5] = static_cast<T>(std::numeric_limits<std::int32_t>::max());
  return values;
}

Bytes gzip(const Bytes& plain);

/// The fields of a NIfTI header that tests vary.
struct NiftiFile {
  int version = 1;
  bool big_endian = false;
  bool two_files = false;
  std::vector<std::int64_t> dim{2, 3, 4};
  int datatype = 2, bits = 8;
  std::vector<double> pixdim{1, 1, 1, 1, 1, 0, 0, 0};
  double slope = 0, intercept = 0;
  int units = 2;  ///< mm
  int qform_code = 0, sform_code = 0;
  std::array<double, 3> quatern{}, qoffset{};
  std::array<std::array<double, 4>, 3> srow{};
  double vox_offset = -1;  ///< negative: the usual one

  [[nodiscard]] Bytes header() const;
};

/// NIfTI data type code and bits of an element type.
template <class T>
void set_type(NiftiFile& file);

/// A PNG file of the given colour type (0 grey, 2 RGB, 3 palette, 4 grey with alpha); rows hold packed samples, big
/// endian.
Bytes png_file(unsigned width, unsigned height, unsigned bits, unsigned color, const std::vector<Bytes>& rows);

struct TiffOptions {
  bool big_endian = false;
  std::uint16_t photometric = 1;
  std::uint16_t samples_per_pixel = 1;
  std::uint16_t format = 1;  ///< 1 unsigned, 2 signed, 3 floating point
  std::uint16_t bits = 8;
  std::uint16_t compression = 1;
  std::uint32_t tile = 0;  ///< side of tiles, 0 for strips
};

/// Writes the pages of a TIFF file through libtiff; each page holds packed rows.
void write_tiff(const std::string& path, unsigned width, unsigned height, const std::vector<Bytes>& pages,
                const TiffOptions& options);

struct DicomSlice {
  unsigned columns = 3, rows = 2;
  std::array<double, 3> position{};
  std::array<double, 6> orientation{1, 0, 0, 0, 1, 0};
  double row_spacing = 1, column_spacing = 1;
  std::string series = "1.2.3";
  std::string slope, intercept;
  unsigned stored = 16;  ///< bits
  bool is_signed = false;
  std::vector<std::uint16_t> values;  ///< columns * rows
};

/// A DICOM file, explicit little endian, of 16-bit samples.
Bytes dicom_file(const DicomSlice& slice);

/// The labels of an image, in scan order.
template <int Dim>
std::vector<std::int64_t> labels_of(const LabelImage<Dim>& image) {
  std::vector<std::int64_t> labels;
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) labels.push_back(image.labels[image.voxels[i]]);
  return labels;
}

/// Reads a label image of known dimension; fails the test with the error's text otherwise.
template <int Dim>
LabelImage<Dim> read(const std::string& path, const ReadOptions& options = {}) {
  const Execution execution(2);
  return std::get<LabelImage<Dim>>(read_label_image(path, options, execution));
}

/// The error that reading gives, "" if it gives none. Checks that it is one line that names the file and what to do.
std::string error_of(const std::string& path, const ReadOptions& options = {}, ErrorKind kind = ErrorKind::input);

/// The warnings of a successful reading.
std::vector<std::string> warnings_of(const std::string& path);

}  // namespace treemarch::testing
