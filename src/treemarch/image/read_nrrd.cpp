#include "treemarch/image/read_nrrd.h"

#include <itkNrrdImageIO.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>

#include "treemarch/core/error.h"
#include "treemarch/image/itk_support.h"
#include "treemarch/image/nrrd_header.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// Which axes of the array are axes of space, and which one (if any) counts volumes.
struct AxisRoles {
  std::vector<std::size_t> space;
  std::optional<std::size_t> volumes;
};

AxisRoles axis_roles(const std::string& path, const NrrdGeometry& geometry) {
  AxisRoles roles;
  const auto& axes = geometry.axes;
  for (std::size_t a = 0; a < axes.size(); ++a) {
    const std::string& kind = axes[a].kind;
    const bool place = kind.empty() || kind == "domain" || kind == "space";
    if (roles.space.size() < 3 && (geometry.has_directions ? !axes[a].direction.empty() && kind != "time" : place)) {
      roles.space.push_back(a);
    } else if (axes[a].size > 1) {
      const bool last = a + 1 == axes.size();
      if (roles.volumes || !(kind == "list" || (last && (place || kind == "time"))))
        fail(path, "has " + std::to_string(axes[a].size) + " values a voxel (axis " + std::to_string(a + 1) +
                       (kind.empty() ? "" : " of kind " + kind) +
                       "); give an image with one label or grey value a voxel");
      roles.volumes = a;
    }
  }
  if (roles.space.size() < 2) fail(path, "is one-dimensional; give an image of two or three dimensions");
  return roles;
}

void set_geometry(const std::string& path, const NrrdGeometry& geometry, const AxisRoles& roles, RawImage& image) {
  const std::size_t dim = roles.space.size();
  image.dim = static_cast<int>(dim);
  image.space = geometry.space.substr(0, dim);
  image.has_spacing = false;
  for (std::size_t c = 0; c < dim; ++c) {
    const NrrdAxis& axis = geometry.axes[roles.space[c]];
    image.extent[c] = axis.size;
    if (geometry.has_directions) {
      // A vector may be longer than the image has axes (time); a shorter one says too little.
      if (axis.direction.size() < dim) fail(path, "its space directions have too few components; repair the header");
      for (std::size_t r = 0; r < dim; ++r) image.axis[c][r] = axis.direction[r];
      image.has_spacing = true;
    } else if (axis.has_spacing) {
      image.axis[c][c] = axis.spacing;
      image.has_spacing = true;
    }
  }
  if (!geometry.origin.empty()) {
    if (geometry.origin.size() < dim) fail(path, "its space origin has too few components; repair the header");
    for (std::size_t r = 0; r < dim; ++r) image.origin[r] = geometry.origin[r];
  }
  if (roles.volumes) {
    const NrrdAxis& axis = geometry.axes[*roles.volumes];
    image.volumes = axis.size;
    if (std::isfinite(axis.spacing) && axis.spacing > 0) image.volume_spacing = axis.spacing;
  }
}

/// Size of the file that holds the samples, or -1 where they are spread over several.
std::int64_t stored_bytes(const std::string& path, const NrrdHeader& header) {
  std::string name = header.field("data file");
  if (name.empty()) name = header.field("datafile");
  std::error_code failed;
  if (name.empty())
    return static_cast<std::int64_t>(std::filesystem::file_size(path, failed)) -
           static_cast<std::int64_t>(header.bytes);
  if (name.starts_with("LIST") || name.find('%') != std::string::npos) return -1;
  const std::filesystem::path data = std::filesystem::path(path).parent_path() / name;  // `name` if that is absolute
  const auto bytes = std::filesystem::file_size(data, failed);
  if (failed) fail(path, "its data file " + data.string() + " is missing; put it beside the header");
  return static_cast<std::int64_t>(bytes);
}

double largest_compression(const NrrdHeader& header, std::size_t sample) {
  const std::string& encoding = header.field("encoding");
  if (encoding == "raw") return 1;
  if (encoding == "ascii" || encoding == "text" || encoding == "txt") return static_cast<double>(sample);
  return kDeflateRatio;
}

/// Turns volumes that alternate from sample to sample into volumes one after the other.
void deinterleave(const std::vector<std::byte>& in, std::size_t sample, RawImage& image) {
  const auto voxels = static_cast<std::size_t>(image.voxels());
  const auto volumes = static_cast<std::size_t>(image.volumes);
  for (std::size_t v = 0; v < volumes; ++v)
    for (std::size_t i = 0; i < voxels; ++i)
      std::memcpy(image.data.get() + (v * voxels + i) * sample, in.data() + (i * volumes + v) * sample, sample);
}

}  // namespace

RawImage read_nrrd(const std::string& path) {
  const NrrdHeader header = read_nrrd_header(path);
  const NrrdGeometry geometry = nrrd_geometry(path, header);
  const AxisRoles roles = axis_roles(path, geometry);
  std::vector<std::int64_t> sizes;
  for (const NrrdAxis& axis : geometry.axes) sizes.push_back(axis.size);
  const std::int64_t bytes_there = stored_bytes(path, header);
  check_size(path, sizes, 1, bytes_there, largest_compression(header, 1));  // before ITK allocates anything

  RawImage image;
  set_geometry(path, geometry, roles, image);
  image.names = nrrd_segment_names(header);
  guard_itk(path, [&] {
    const auto io = itk::NrrdImageIO::New();
    io->SetFileName(path);
    io->ReadImageInformation();
    const bool layers = roles.volumes && io->GetNumberOfComponents() == static_cast<unsigned>(image.volumes);
    if (layers) {
      io->SetNumberOfComponents(1);
      io->SetPixelType(itk::IOPixelEnum::SCALAR);
    }
    image.type = itk_sample_type(path, *io);
    const std::size_t sample = sample_bytes(image.type);
    check_size(path, sizes, sample, bytes_there, largest_compression(header, sample));
    std::size_t samples = layers ? static_cast<std::size_t>(image.volumes) : 1;
    for (unsigned d = 0; d < io->GetNumberOfDimensions(); ++d) samples *= io->GetDimensions(d);
    if (samples != static_cast<std::size_t>(image.voxels() * image.volumes))
      fail(path, "its axes cannot be told apart; give their kinds in the header");
    image.allocate(path);
    if (!layers) {
      read_itk_samples(*io, image.data.get());
      return;
    }
    io->SetNumberOfComponents(static_cast<unsigned>(image.volumes));
    std::vector<std::byte> interleaved(samples * sample);
    read_itk_samples(*io, interleaved.data());
    deinterleave(interleaved, sample, image);
  });
  return image;
}

}  // namespace treemarch
