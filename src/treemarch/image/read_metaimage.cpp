#include "treemarch/image/read_metaimage.h"

#include <itkMetaImageIO.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "treemarch/core/error.h"
#include "treemarch/image/itk_support.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// The part of the header that must be known before ITK reads samples, since ITK trusts it.
struct Header {
  std::string data_file;  ///< empty for the header's own file, "LIST" or a pattern for several
  std::size_t bytes = 0;  ///< length of the header
  bool compressed = false;
  bool spacing_given = false;
};

Header read_header(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  Header header;
  constexpr std::size_t kLongest = 1U << 20;
  for (std::string line; header.bytes < kLongest && std::getline(in, line);) {
    header.bytes += line.size() + 1;
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos) continue;
    const auto trimmed = [](const std::string& s) {
      const auto begin = s.find_first_not_of(" \t\r");
      return begin == std::string::npos ? std::string() : s.substr(begin, s.find_last_not_of(" \t\r") - begin + 1);
    };
    const std::string name = trimmed(line.substr(0, equals));
    const std::string value = trimmed(line.substr(equals + 1));
    if (name == "CompressedData") header.compressed = value.starts_with('T') || value.starts_with('t');
    if (name == "ElementSpacing" || name == "ElementSize") header.spacing_given = true;
    if (name == "ElementDataFile") {  // the last field by definition
      header.data_file = value == "LOCAL" || value == "Local" || value == "local" ? "" : value;
      return header;
    }
  }
  fail(path, "its header has no 'ElementDataFile'; the file is cut short or is not a MetaImage");
}

/// Size of the file that holds the samples, or -1 where they are spread over several.
std::int64_t stored_bytes(const std::string& path, const Header& header) {
  std::error_code failed;
  if (header.data_file.empty())
    return static_cast<std::int64_t>(std::filesystem::file_size(path, failed)) -
           static_cast<std::int64_t>(header.bytes);
  if (header.data_file.starts_with("LIST") || header.data_file.find('%') != std::string::npos) return -1;
  const auto data = std::filesystem::path(path).parent_path() / header.data_file;
  const auto bytes = std::filesystem::file_size(data, failed);
  if (failed) fail(path, "its data file " + data.string() + " is missing; put it beside the header");
  return static_cast<std::int64_t>(bytes);
}

void set_geometry(const std::string& path, const itk::ImageIOBase& io, RawImage& image) {
  unsigned dims = io.GetNumberOfDimensions();
  while (dims > 3 && io.GetDimensions(dims - 1) == 1) --dims;
  if (dims < 2 || dims > 4)
    fail(path, "has " + std::to_string(dims) + " dimensions; give an image of two or three dimensions");
  image.dim = dims == 2 ? 2 : 3;
  image.space = std::string("LPS").substr(0, static_cast<std::size_t>(image.dim));
  for (unsigned c = 0; c < static_cast<unsigned>(image.dim); ++c) {
    image.extent[c] = static_cast<std::int64_t>(io.GetDimensions(c));
    image.origin[c] = io.GetOrigin(c);
    const std::vector<double> direction = io.GetDirection(c);
    for (unsigned r = 0; r < static_cast<unsigned>(image.dim); ++r) image.axis[c][r] = direction[r] * io.GetSpacing(c);
  }
  if (dims == 4) {
    image.volumes = static_cast<std::int64_t>(io.GetDimensions(3));
    const double step = io.GetSpacing(3);
    if (std::isfinite(step) && step > 0) image.volume_spacing = step;
  }
}

}  // namespace

RawImage read_metaimage(const std::string& path) {
  const Header header = read_header(path);
  const std::int64_t bytes_there = stored_bytes(path, header);
  RawImage image;
  guard_itk(path, [&] {
    const auto io = itk::MetaImageIO::New();
    io->SetFileName(path);
    io->ReadImageInformation();
    image.type = itk_sample_type(path, *io);
    std::vector<std::int64_t> sizes;
    for (unsigned d = 0; d < io->GetNumberOfDimensions(); ++d)
      sizes.push_back(static_cast<std::int64_t>(io->GetDimensions(d)));
    const double ratio = header.compressed ? kDeflateRatio : static_cast<double>(sample_bytes(image.type));
    check_size(path, sizes, sample_bytes(image.type), bytes_there, ratio);
    set_geometry(path, *io, image);
    image.has_spacing = header.spacing_given;
    image.allocate(path);
    read_itk_samples(*io, image.data.get());
  });
  return image;
}

}  // namespace treemarch
