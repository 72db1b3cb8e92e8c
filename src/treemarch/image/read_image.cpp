#include "treemarch/image/read_image.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <new>

#include "treemarch/core/error.h"
#include "treemarch/image/convert_raw.h"
#include "treemarch/image/read_dicom.h"
#include "treemarch/image/read_metaimage.h"
#include "treemarch/image/read_nifti.h"
#include "treemarch/image/read_nrrd.h"
#include "treemarch/image/read_png.h"
#include "treemarch/image/read_tiff.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

enum class Format { nifti, nrrd, metaimage, tiff, png, dicom, unknown };

bool ends_with(const std::string& path, std::initializer_list<const char*> ends) {
  std::string lower = path;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::any_of(ends.begin(), ends.end(), [&](const char* end) { return lower.ends_with(end); });
}

/// The first bytes of a file; zeros where it is shorter.
std::array<char, 512> first_bytes(const std::string& path) {
  std::array<char, 512> start{};
  std::FILE* f = std::fopen(path.c_str(), "rb");
  if (!f) fail(path, std::string("cannot be opened (") + std::strerror(errno) + "); check its permissions");
  const std::size_t got = std::fread(start.data(), 1, start.size(), f);
  std::fclose(f);
  if (got == 0) fail(path, "is empty; get a complete copy");
  return start;
}

/// What a file is: its content counts more than its name.
Format format_of(const std::string& path) {
  const std::array<char, 512> start = first_bytes(path);
  const auto begins = [&](std::string_view magic, std::size_t at = 0) {
    return std::memcmp(start.data() + at, magic.data(), magic.size()) == 0;
  };
  using std::string_view_literals::operator""sv;
  if (begins("NRRD")) return Format::nrrd;
  if (begins("\x89PNG\r\n\x1a\n")) return Format::png;
  if (begins("II*\0"sv) || begins("MM\0*"sv) || begins("II+\0"sv) || begins("MM\0+"sv)) return Format::tiff;
  if (begins("DICM", 128)) return Format::dicom;
  if (begins("\x5c\1\0\0"sv) || begins("\0\0\1\x5c"sv) || begins("\x1c\2\0\0"sv) || begins("\0\0\2\x1c"sv))
    return Format::nifti;
  const std::string_view text(start.data(), start.size());
  if (text.find("ObjectType") != text.npos || text.find("NDims") != text.npos) return Format::metaimage;

  if (ends_with(path, {".nii", ".nii.gz", ".hdr", ".hdr.gz"}) || begins("\x1f\x8b")) return Format::nifti;
  if (ends_with(path, {".nrrd", ".nhdr"})) return Format::nrrd;
  if (ends_with(path, {".mha", ".mhd"})) return Format::metaimage;
  if (ends_with(path, {".tif", ".tiff"})) return Format::tiff;
  if (ends_with(path, {".png"})) return Format::png;
  if (ends_with(path, {".dcm", ".ima"})) return Format::dicom;
  return Format::unknown;
}

RawImage read_file(const std::string& path, const Execution& execution) {
  switch (format_of(path)) {
    case Format::nifti:
      return read_nifti(path, execution);
    case Format::nrrd:
      return read_nrrd(path);
    case Format::metaimage:
      return read_metaimage(path);
    case Format::tiff:
      return read_tiff(path);
    case Format::png:
      return read_png(path);
    case Format::dicom:
      return read_dicom(path, execution);
    default:
      break;
  }
  if (ends_with(path, {".raw", ".zraw", ".img", ".raw.gz"}))
    fail(path, "holds samples without a description; give its header file (.mhd, .nhdr, .hdr)");
  fail(path, "is not an image that can be read; give NIfTI, NRRD, MetaImage, TIFF, PNG or DICOM");
}

/// Order of names in which numbers count as numbers: slice2 before slice10.
bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (digit(a[i]) && digit(b[j])) {
      while (i + 1 < a.size() && a[i] == '0' && digit(a[i + 1])) ++i;
      while (j + 1 < b.size() && b[j] == '0' && digit(b[j + 1])) ++j;
      std::size_t m = i, n = j;
      while (m < a.size() && digit(a[m])) ++m;
      while (n < b.size() && digit(b[n])) ++n;
      if (m - i != n - j) return m - i < n - j;
      if (const int order = a.compare(i, m - i, b, j, n - j); order != 0) return order < 0;
      i = m;
      j = n;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  return a.size() - i != b.size() - j ? a.size() - i < b.size() - j : a < b;
}

RawImage read_folder(const std::string& path, const Execution& execution) {
  std::vector<std::string> slices;
  bool dicom = false;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    const std::string name = entry.path().string();
    if (!entry.is_regular_file() || entry.path().filename().string().starts_with('.')) continue;
    if (ends_with(name, {".png", ".tif", ".tiff"}))
      slices.push_back(name);
    else
      dicom = dicom || is_dicom_file(name);
  }
  if (dicom) return read_dicom(path, execution);
  if (slices.empty())
    fail(path, "is a folder without images; give a file, or a folder with a DICOM series or with TIFF or PNG slices");
  std::sort(slices.begin(), slices.end(), natural_less);
  std::vector<RawImage> images;
  for (const std::string& slice : slices) {
    execution.check();
    images.push_back(read_file(slice, execution));
    images.back().load();
    if (images.back().dim != 2) fail(slice, "is not a single slice, but lies in a folder of slices; give it alone");
  }
  return stack_slices(std::move(images), slices);
}

/// Runs `work`. Messages may quote what a damaged file holds: they stay on one line.
template <class Work>
auto with_plain_messages(const std::string& path, Work&& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::limits, path + ": too large for the memory of this machine; crop or downsample it");
  } catch (const Error& e) {
    std::string text = e.what();
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
    throw Error(e.kind(), text);
  }
}

/// All but the samples.
RawImage read_raw(const std::string& path, const ReadOptions& options, const Execution& execution) {
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  if (!std::filesystem::exists(status)) fail(path, "does not exist; check the name");
  RawImage raw = std::filesystem::is_directory(status) ? read_folder(path, execution) : read_file(path, execution);
  if (!options.spacing.empty()) override_spacing(path, options.spacing, raw);
  return raw;
}

/// Number of the volume to use.
std::int64_t chosen_volume(const std::string& path, const RawImage& raw, const ReadOptions& options) {
  const std::string range = "0 to " + std::to_string(raw.volumes - 1);
  if (!options.volume) {
    if (raw.volumes > 1)
      fail(path, "holds " + std::to_string(raw.volumes) + " volumes; choose one with --volume N, N from " + range);
    return 0;
  }
  if (*options.volume < 0 || *options.volume >= raw.volumes)
    throw Error(ErrorKind::usage, "--volume: " + path + " has no volume " + std::to_string(*options.volume) +
                                      "; give a number from " + range);
  return *options.volume;
}

template <int Dim>
Coord<Dim> extent_of(const RawImage& raw) {
  Coord<Dim> extent{};
  for (int d = 0; d < Dim; ++d)
    extent[d] = static_cast<std::int32_t>(d < raw.dim ? raw.extent[static_cast<std::size_t>(d)] : raw.volumes);
  return extent;
}

template <int Dim>
LabelImage<Dim> to_labels(const std::string& path, RawImage& raw, std::int64_t first, std::int64_t volumes,
                          const ReadOptions& options, const Execution& execution) {
  LabelImage<Dim> image;
  image.extent = extent_of<Dim>(raw);
  image.frame = make_frame<Dim>(path, raw);
  EncodedLabels encoded = convert_labels(path, raw, first, volumes, {options.threshold, options.any_labels}, execution);
  image.voxels = std::move(encoded.voxels);
  image.labels = std::move(encoded.labels);
  if (!raw.names.empty() && !options.threshold) {
    image.names.resize(image.labels.size());
    for (const auto& [label, name] : raw.names)
      for (std::size_t m = 0; m < image.labels.size(); ++m)
        if (image.labels[m] == label) image.names[m] = name;
  }
  return image;
}

template <int Dim>
GreyImage<Dim> to_grey(const std::string& path, RawImage& raw, std::int64_t volume, const Execution& execution) {
  return {extent_of<Dim>(raw), make_frame<Dim>(path, raw), convert_grey(path, raw, volume, execution)};
}

}  // namespace

AnyImage read_label_image(const std::string& path, const ReadOptions& options, const Execution& execution) {
  return with_plain_messages(path, [&]() -> AnyImage {
    RawImage raw = read_raw(path, options, execution);
    if (options.space_time && raw.volumes < 2)
      throw Error(ErrorKind::usage, "--space-time: " + path + " holds a single volume; leave the option out");
    if (options.space_time && options.volume)
      throw Error(ErrorKind::usage, "--volume: is one moment, --space-time is all of them; leave one of them out");
    if (options.space_time) {
      if (raw.dim == 2) return to_labels<3>(path, raw, 0, raw.volumes, options, execution);
      return to_labels<4>(path, raw, 0, raw.volumes, options, execution);
    }
    const std::int64_t volume = chosen_volume(path, raw, options);
    if (raw.dim == 2) return to_labels<2>(path, raw, volume, 1, options, execution);
    return to_labels<3>(path, raw, volume, 1, options, execution);
  });
}

AnyGreyImage read_grey_image(const std::string& path, const ReadOptions& options, const Execution& execution) {
  return with_plain_messages(path, [&]() -> AnyGreyImage {
    RawImage raw = read_raw(path, options, execution);
    const std::int64_t volume = chosen_volume(path, raw, options);
    if (raw.dim == 2) return to_grey<2>(path, raw, volume, execution);
    return to_grey<3>(path, raw, volume, execution);
  });
}

}  // namespace treemarch
