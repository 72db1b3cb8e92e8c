#include "treemarch/image/read_nifti.h"

#include <nifti/nifti2_io.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// A file that may be compressed; libnifti's layer over zlib.
class ZFile {
 public:
  explicit ZFile(const std::string& path) : path_(path), file_(znzopen(path.c_str(), "rb", 1)) {
    if (znz_isnull(file_)) fail(path, "cannot be opened; check that it exists and may be read");
  }
  ~ZFile() { Xznzclose(&file_); }
  ZFile(const ZFile&) = delete;
  ZFile& operator=(const ZFile&) = delete;

  /// Bytes read: fewer than asked for at the end of the file and where the compressed stream is damaged.
  std::size_t read(void* out, std::size_t bytes) {
    const std::size_t got = znzread(out, 1, bytes, file_);
    damaged_ |= got > bytes;  // a negative number, from zlib
    return got > bytes ? 0 : got;
  }
  [[nodiscard]] bool damaged() const { return damaged_; }

 private:
  std::string path_;
  znzFile file_;
  bool damaged_ = false;
};

/// The fields of both versions that matter here, in this machine's byte order.
struct Header {
  bool swapped = false;
  bool two_files = false;
  std::int64_t header_bytes = 0;
  int datatype = 0;
  std::array<std::int64_t, 8> dim{};
  std::array<double, 8> pixdim{};
  double vox_offset = 0, slope = 0, intercept = 0;
  int qform_code = 0, sform_code = 0, units = 0;
  std::array<double, 3> quatern{}, qoffset{};
  std::array<std::array<double, 4>, 3> srow{};
};

template <class Raw>
Header convert(const Raw& raw) {
  Header h;
  h.header_bytes = sizeof(Raw);
  h.datatype = raw.datatype;
  std::copy(std::begin(raw.dim), std::end(raw.dim), h.dim.begin());
  std::copy(std::begin(raw.pixdim), std::end(raw.pixdim), h.pixdim.begin());
  h.vox_offset = static_cast<double>(raw.vox_offset);
  h.slope = raw.scl_slope;
  h.intercept = raw.scl_inter;
  h.qform_code = raw.qform_code;
  h.sform_code = raw.sform_code;
  h.units = raw.xyzt_units;
  h.quatern = {raw.quatern_b, raw.quatern_c, raw.quatern_d};
  h.qoffset = {raw.qoffset_x, raw.qoffset_y, raw.qoffset_z};
  std::copy(std::begin(raw.srow_x), std::end(raw.srow_x), h.srow[0].begin());
  std::copy(std::begin(raw.srow_y), std::end(raw.srow_y), h.srow[1].begin());
  std::copy(std::begin(raw.srow_z), std::end(raw.srow_z), h.srow[2].begin());
  return h;
}

Header read_header(const std::string& path) {
  nifti_set_debug_level(0);  // the library prints otherwise
  std::array<char, sizeof(nifti_2_header)> buffer{};
  ZFile file(path);
  const std::size_t got = file.read(buffer.data(), buffer.size());
  if (file.damaged()) fail(path, "its compressed data are damaged; get a complete copy");
  if (got < sizeof(nifti_1_header))
    fail(path, "is cut short within its header (" + std::to_string(got) + " bytes); get a complete copy");
  std::int32_t size = 0;
  std::memcpy(&size, buffer.data(), sizeof size);
  const int version = nifti_header_version(buffer.data(), got);
  if (version < 1) {
    if (size == 348 || size == 0x5c010000)
      fail(path, "is an Analyze 7.5 file or its magic is damaged; convert it to NIfTI");
    fail(path, "is not a NIfTI file; check the name or convert it");
  }
  if (version == 2 && got < sizeof(nifti_2_header))
    fail(path, "is cut short within its header (" + std::to_string(got) + " bytes); get a complete copy");

  Header header;
  if (version == 1) {
    nifti_1_header raw;
    std::memcpy(&raw, buffer.data(), sizeof raw);
    const bool swapped = raw.sizeof_hdr != 348;
    if (swapped) nifti_swap_as_nifti1(&raw);
    header = convert(raw);
    header.swapped = swapped;
    header.two_files = raw.magic[1] == 'i';
  } else {
    nifti_2_header raw;
    std::memcpy(&raw, buffer.data(), sizeof raw);
    const bool swapped = raw.sizeof_hdr != 540;
    if (swapped) nifti_swap_as_nifti2(&raw);
    header = convert(raw);
    header.swapped = swapped;
    header.two_files = raw.magic[1] == 'i';
  }
  return header;
}

SampleType sample_type(const std::string& path, int datatype) {
  switch (datatype) {
    case DT_UINT8:
      return SampleType::u8;
    case DT_INT8:
      return SampleType::i8;
    case DT_UINT16:
      return SampleType::u16;
    case DT_INT16:
      return SampleType::i16;
    case DT_UINT32:
      return SampleType::u32;
    case DT_INT32:
      return SampleType::i32;
    case DT_UINT64:
      return SampleType::u64;
    case DT_INT64:
      return SampleType::i64;
    case DT_FLOAT32:
      return SampleType::f32;
    case DT_FLOAT64:
      return SampleType::f64;
    case DT_RGB24:
    case DT_RGBA32:
      fail(path, "is a colour (RGB) image; give an image with one label or grey value a voxel");
    default:
      break;
  }
  fail(path, "has the data type " + std::string(nifti_datatype_string(datatype)) + " (" + std::to_string(datatype) +
                 "); convert it to an integer type or to float");
}

using Affine = std::array<std::array<double, 4>, 3>;

bool finite(const Affine& a) {
  return std::all_of(a.begin(), a.end(), [](const auto& row) {
    return std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); });
  });
}

Affine qform_affine(const Header& h) {
  const auto& d = h.pixdim;
  const nifti_dmat44 m =
      nifti_quatern_to_dmat44(h.quatern[0], h.quatern[1], h.quatern[2], h.qoffset[0], h.qoffset[1], h.qoffset[2],
                              std::abs(d[1]), std::abs(d[2]), std::abs(d[3]), d[0] < 0 ? -1.0 : 1.0);
  Affine a{};
  for (std::size_t r = 0; r < 3; ++r) std::copy_n(m.m[r], 4, a[r].begin());
  return a;
}

/// Largest distance between the places of a corner of the image, in units of the smallest spacing.
double largest_difference(const Affine& a, const Affine& b, const std::array<std::int64_t, 3>& extent) {
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < 3; ++c) smallest = std::min(smallest, std::hypot(a[0][c], a[1][c], a[2][c]));
  double worst = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::array<double, 3> d{};
    for (std::size_t r = 0; r < 3; ++r) {
      d[r] = a[r][3] - b[r][3];
      for (std::size_t c = 0; c < 3; ++c)
        if (corner >> c & 1U) d[r] += (a[r][c] - b[r][c]) * static_cast<double>(extent[c] - 1);
    }
    worst = std::max(worst, std::hypot(d[0], d[1], d[2]));
  }
  return worst / smallest;
}

double millimetres(int units) {
  switch (units & 0x07) {
    case NIFTI_UNITS_METER:
      return 1000;
    case NIFTI_UNITS_MICRON:
      return 0.001;
    default:
      return 1;
  }
}

double seconds(int units) {
  switch (units & 0x38) {
    case NIFTI_UNITS_MSEC:
      return 1e-3;
    case NIFTI_UNITS_USEC:
      return 1e-6;
    default:
      return 1;
  }
}

/// sform before qform before the spacing alone (the order of the format's documentation).
Affine choose_affine(const std::string& path, const Header& h, const RawImage& image, const Execution& execution) {
  const Affine sform = h.srow;
  if (h.sform_code > 0) {
    if (!finite(sform)) fail(path, "its sform is not finite; repair the header");
    if (h.qform_code > 0) {
      const Affine qform = qform_affine(h);
      if (!(finite(qform) && largest_difference(sform, qform, image.extent) < 0.1))
        execution.warn(path + ": its sform and qform disagree; the sform is used");
    }
    return sform;
  }
  if (h.qform_code > 0) {
    const Affine qform = qform_affine(h);
    if (!finite(qform)) fail(path, "its qform is not finite; repair the header");
    return qform;
  }
  execution.warn(path + ": has neither sform nor qform; its spacing alone is used, with voxel 0 at the origin");
  Affine a{};
  for (std::size_t c = 0; c < 3; ++c) a[c][c] = c < static_cast<std::size_t>(image.dim) ? std::abs(h.pixdim[c + 1]) : 1;
  return a;
}

void set_geometry(const std::string& path, const Header& h, RawImage& image, const Execution& execution) {
  for (std::size_t c = 1; c <= static_cast<std::size_t>(image.dim); ++c)
    if (!std::isfinite(h.pixdim[c]) || h.pixdim[c] == 0)
      fail(path, "the spacing of axis " + std::to_string(c) + " (pixdim) is " +
                     (h.pixdim[c] == 0 ? "0" : "not a number") + "; repair the header");
  Affine a = choose_affine(path, h, image, execution);
  const double unit = millimetres(h.units);
  for (auto& row : a)
    for (double& v : row) v *= unit;
  image.space = image.dim == 3 ? "RAS" : "RA";
  for (std::size_t c = 0; c < 3; ++c) {
    image.axis[c] = {a[0][c], a[1][c], a[2][c]};
    image.origin[c] = a[c][3];
  }
  if (image.dim == 2 && (std::abs(a[2][0]) > 1e-6 * unit || std::abs(a[2][1]) > 1e-6 * unit)) {
    execution.warn(path + ": the plane of this 2D image is tilted in space; coordinates within its plane are used");
    image.space.clear();
    image.axis[0] = {std::hypot(a[0][0], a[1][0], a[2][0]), 0, 0};
    image.axis[1] = {0, std::hypot(a[0][1], a[1][1], a[2][1]), 0};
    image.origin = {};
  }
  const double step = h.pixdim[4] * seconds(h.units);
  image.volume_spacing = image.volumes > 1 && std::isfinite(step) && step > 0 ? step : 1;
}

std::int64_t file_size(const std::string& path) {
  std::error_code failed;
  const auto size = std::filesystem::file_size(path, failed);
  return failed ? -1 : static_cast<std::int64_t>(size);
}

bool is_gzip(const std::string& path) {
  std::array<unsigned char, 2> magic{};
  if (std::FILE* f = std::fopen(path.c_str(), "rb")) {
    if (std::fread(magic.data(), 1, 2, f) != 2) magic = {};
    std::fclose(f);
  }
  return magic[0] == 0x1f && magic[1] == 0x8b;
}

/// The file that holds the samples.
std::string data_path(const std::string& path, const Header& h) {
  if (!h.two_files) return path;
  std::string base = path;
  for (const char* end : {".gz", ".hdr", ".img", ".nii"})
    if (base.ends_with(end)) base.resize(base.size() - std::strlen(end));
  for (const char* end : {".img", ".img.gz"})
    if (std::filesystem::exists(base + end)) return base + end;
  fail(path, "its data file " + base + ".img is missing; put it beside the header");
}

class NiftiSamples : public SampleStream {
 public:
  /// \param bytes of all samples. \param sample bytes of one whose order is to be reversed, else 1
  NiftiSamples(const std::string& path, std::int64_t offset, std::size_t bytes, int sample)
      : path_(path), file_(path), bytes_(bytes), sample_(sample) {
    // By reading, not seeking: a compressed stream has to be read anyway, and the offset is small.
    constexpr std::size_t kChunk = std::size_t{1} << 24;
    std::vector<std::byte> skipped(std::min(kChunk, static_cast<std::size_t>(offset)));
    for (std::int64_t left = offset; left > 0;) {
      const std::size_t n = std::min(skipped.size(), static_cast<std::size_t>(left));
      if (file_.read(skipped.data(), n) != n) break;
      left -= static_cast<std::int64_t>(n);
    }
  }
  void read(std::byte* to, std::size_t bytes) override {
    const std::size_t got = file_.read(to, bytes);
    at_ += got;
    std::byte beyond{};
    if (at_ == bytes_) file_.read(&beyond, 1);  // reaches the checksum of a compressed stream
    if (file_.damaged()) fail(path_, "its compressed data are damaged; get a complete copy");
    if (got < bytes)
      fail(path_, "is cut short: " + std::to_string(at_) + " of " + std::to_string(bytes_) +
                      " bytes of data are there; get a complete copy");
    if (sample_ > 1) nifti_swap_Nbytes(static_cast<std::int64_t>(bytes) / sample_, sample_, to);
  }

 private:
  std::string path_;
  ZFile file_;
  std::size_t bytes_, at_ = 0;
  int sample_;
};

}  // namespace

RawImage read_nifti(const std::string& path, const Execution& execution) {
  const Header h = read_header(path);
  if (h.dim[0] < 1 || h.dim[0] > 7)
    fail(path, "its header claims " + std::to_string(h.dim[0]) + " dimensions, which cannot be; the file is damaged");
  std::size_t dims = static_cast<std::size_t>(h.dim[0]);
  while (dims > 3 && h.dim[dims] == 1) --dims;
  if (dims < 2) fail(path, "is one-dimensional; give an image of two or three dimensions");

  RawImage image;
  image.type = sample_type(path, h.datatype);
  image.dim = static_cast<int>(std::min<std::size_t>(dims, 3));
  const std::string samples = data_path(path, h);
  const bool compressed = is_gzip(samples);
  check_size(path, std::span(h.dim).subspan(1, dims), sample_bytes(image.type), file_size(samples),
             compressed ? kDeflateRatio : 1);
  for (std::size_t d = 0; d < dims; ++d) {
    if (d < 3)
      image.extent[d] = h.dim[d + 1];
    else
      image.volumes *= h.dim[d + 1];
  }
  if (std::isfinite(h.slope) && h.slope != 0) {
    image.slope = h.slope;
    image.intercept = h.intercept;
    if (!std::isfinite(h.intercept)) fail(path, "its scl_inter is not a number; repair the header");
  }
  set_geometry(path, h, image, execution);

  const std::int64_t smallest_offset = h.two_files ? 0 : h.header_bytes + 4;
  if (!(std::abs(h.vox_offset) < 9e15)) fail(path, "its vox_offset cannot be; the file is damaged");
  const std::int64_t offset = std::max(smallest_offset, static_cast<std::int64_t>(h.vox_offset));
  if (!compressed && offset > file_size(samples)) fail(path, "its vox_offset lies beyond its end; the file is damaged");
  const int swapped = h.swapped ? static_cast<int>(sample_bytes(image.type)) : 1;
  image.samples = std::make_unique<NiftiSamples>(samples, offset, image.bytes(), swapped);
  return image;
}

}  // namespace treemarch
