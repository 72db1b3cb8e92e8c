/// \file
/// Where a text header (NRRD, MetaImage) says that its samples are, and how to read them. Read here and not through
/// ITK: its readers hand over what a file that is cut short leaves undefined, and print.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "treemarch/image/raw_image.h"

namespace treemarch {

enum class SampleEncoding : std::uint8_t { raw, deflate, text };

struct SampleSource {
  std::vector<std::string> files;  ///< each holds an equal part of the samples, in order
  std::int64_t skip_lines = 0;     ///< lines before the samples of each file
  std::int64_t skip_bytes = 0;     ///< bytes after those; negative: the samples are the last bytes (raw only)
  SampleEncoding encoding = SampleEncoding::raw;  ///< deflate: zlib or gzip, whichever the data are
  bool big_endian = false;
};

/// Compares the sizes of the image with those of the files, and sets image.samples. `sizes` are those of all axes as
/// the header gives them. \pre image.extent, volumes and type are set and fit `sizes` \throw Error(input) where a file
/// is missing or too short
void open_samples(const std::string& path, const SampleSource& source, std::span<const std::int64_t> sizes,
                  RawImage& image);

/// The files "name" stands for, beside `header`: one, or those of a pattern with one %d (%3d, %03d) and numbers from
/// `first` to `last`. \throw Error(input) for other patterns
std::vector<std::string> files_of_pattern(const std::string& header, const std::string& pattern, std::int64_t first,
                                          std::int64_t last, std::int64_t step);

/// `name` in the folder of `header`.
std::string beside(const std::string& header, const std::string& name);

}  // namespace treemarch
