#include "image/image_files.h"

#include <gtest/gtest.h>
#include <tiffio.h>
#include <unistd.h>
#include <zlib.h>

#include <atomic>
#include <cstring>
#include <fstream>

namespace treemarch::testing {

TemporaryFolder::TemporaryFolder() {
  static std::atomic<int> count{0};
  folder_ = std::filesystem::temp_directory_path() /
            ("treemarch_image_" + std::to_string(::getpid()) + "_" + std::to_string(++count));
  std::filesystem::create_directories(folder_);
}

TemporaryFolder::~TemporaryFolder() { std::filesystem::remove_all(folder_); }

std::string TemporaryFolder::path(const std::string& name) const { return name.empty() ? folder_ : folder_ / name; }

std::string TemporaryFolder::write(const std::string& name, const Bytes& content) const {
  std::filesystem::create_directories((folder_ / name).parent_path());
  std::filesystem::remove(folder_ / name);  // to truncate a file instead makes some file systems wait for the disk
  std::ofstream(folder_ / name, std::ios::binary) << content;
  return folder_ / name;
}

Bytes gzip(const Bytes& plain) {
  z_stream z{};
  deflateInit2(&z, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
  Bytes out(deflateBound(&z, plain.size()) + 64, '\0');
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(plain.data()));
  z.avail_in = static_cast<uInt>(plain.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data());
  z.avail_out = static_cast<uInt>(out.size());
  deflate(&z, Z_FINISH);
  out.resize(z.total_out);
  deflateEnd(&z);
  return out;
}

Bytes NiftiFile::header() const {
  const bool one = version == 1;
  Bytes h((one ? 348U : 540U) + 4U, '\0');
  const auto put = [&](std::size_t at, const Bytes& b) { h.replace(at, b.size(), b); };
  // The same field at its place and type in either version.
  const auto real = [&](std::size_t at1, std::size_t at2, double v) {
    put(one ? at1 : at2, one ? bytes_of(static_cast<float>(v), big_endian) : bytes_of(v, big_endian));
  };
  const auto code = [&](std::size_t at1, std::size_t at2, int v) {
    put(one ? at1 : at2, one ? bytes_of(static_cast<std::int16_t>(v), big_endian) : bytes_of(v, big_endian));
  };
  put(0, bytes_of(one ? 348 : 540, big_endian));
  const std::string kind = two_files ? "i" : "+";
  Bytes magic = "n" + kind + (one ? "1" : "2");
  magic += one ? Bytes(1, '\0') : Bytes("\0\r\n\x1a\n", 5);
  put(one ? 344 : 4, magic);
  put(one ? 70 : 12, bytes_of(static_cast<std::int16_t>(datatype), big_endian));
  put(one ? 72 : 14, bytes_of(static_cast<std::int16_t>(bits), big_endian));
  const auto dims = [&](std::size_t i, std::int64_t v) {
    put(one ? 40 + 2 * i : 16 + 8 * i,
        one ? bytes_of(static_cast<std::int16_t>(v), big_endian) : bytes_of(v, big_endian));
  };
  for (std::size_t i = 0; i < 8; ++i) {
    dims(i, i == 0 ? static_cast<std::int64_t>(dim.size()) : i <= dim.size() ? dim[i - 1] : 1);
    real(76 + 4 * i, 104 + 8 * i, pixdim[i]);
  }
  const double offset = vox_offset >= 0 ? vox_offset : two_files ? 0 : static_cast<double>(h.size());
  if (one)
    put(108, bytes_of(static_cast<float>(offset), big_endian));
  else
    put(168, bytes_of(static_cast<std::int64_t>(offset), big_endian));
  real(112, 176, slope);
  real(116, 184, intercept);
  if (one)
    h[123] = static_cast<char>(units);
  else
    put(500, bytes_of(units, big_endian));
  code(252, 344, qform_code);
  code(254, 348, sform_code);
  for (std::size_t i = 0; i < 3; ++i) {
    real(256 + 4 * i, 352 + 8 * i, quatern[i]);
    real(268 + 4 * i, 376 + 8 * i, qoffset[i]);
    for (std::size_t j = 0; j < 4; ++j) real(280 + 16 * i + 4 * j, 400 + 32 * i + 8 * j, srow[i][j]);
  }
  if (two_files) h.resize(h.size() - 4);
  return h;
}

namespace {
void set(NiftiFile& file, int datatype, int bits) {
  file.datatype = datatype;
  file.bits = bits;
}
}  // namespace

template <>
void set_type<std::uint8_t>(NiftiFile& f) {
  set(f, 2, 8);
}
template <>
void set_type<std::int8_t>(NiftiFile& f) {
  set(f, 256, 8);
}
template <>
void set_type<std::uint16_t>(NiftiFile& f) {
  set(f, 512, 16);
}
template <>
void set_type<std::int16_t>(NiftiFile& f) {
  set(f, 4, 16);
}
template <>
void set_type<std::uint32_t>(NiftiFile& f) {
  set(f, 768, 32);
}
template <>
void set_type<std::int32_t>(NiftiFile& f) {
  set(f, 8, 32);
}
template <>
void set_type<std::uint64_t>(NiftiFile& f) {
  set(f, 1280, 64);
}
template <>
void set_type<std::int64_t>(NiftiFile& f) {
  set(f, 1024, 64);
}
template <>
void set_type<float>(NiftiFile& f) {
  set(f, 16, 32);
}
template <>
void set_type<double>(NiftiFile& f) {
  set(f, 64, 64);
}

namespace {

Bytes png_chunk(const std::string& type, const Bytes& data) {
  const Bytes body = type + data;
  const auto crc = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return bytes_of(static_cast<std::uint32_t>(data.size()), true) + body +
         bytes_of(static_cast<std::uint32_t>(crc), true);
}

}  // namespace

Bytes png_file(unsigned width, unsigned height, unsigned bits, unsigned color, const std::vector<Bytes>& rows) {
  Bytes raw;
  for (const Bytes& row : rows) raw += '\0' + row;
  Bytes packed(compressBound(raw.size()), '\0');
  uLongf size = packed.size();
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(raw.data()), raw.size());
  packed.resize(size);
  const Bytes header = bytes_of(width, true) + bytes_of(height, true) + static_cast<char>(bits) +
                       static_cast<char>(color) + Bytes(3, '\0');
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + (color == 3 ? png_chunk("PLTE", Bytes(30, 'x')) : "") +
         png_chunk("IDAT", packed) + png_chunk("IEND", "");
}

void write_tiff(const std::string& path, unsigned width, unsigned height, const std::vector<Bytes>& pages,
                const TiffOptions& o) {
  TIFF* tiff = TIFFOpen(path.c_str(), o.big_endian ? "wb" : "wl");
  ASSERT_NE(tiff, nullptr);
  for (const Bytes& page : pages) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, width);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, height);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, o.bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, o.samples_per_pixel);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, o.format);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, o.photometric);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, o.compression);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    std::vector<std::uint16_t> map(256, 7);
    if (o.photometric == PHOTOMETRIC_PALETTE) TIFFSetField(tiff, TIFFTAG_COLORMAP, map.data(), map.data(), map.data());
    const std::size_t sample = std::size_t{o.bits} * o.samples_per_pixel;
    const std::size_t row = (width * sample + 7) / 8;
    if (o.tile == 0) {
      for (unsigned y = 0; y < height; ++y) {
        Bytes copy = page.substr(y * row, row);
        TIFFWriteScanline(tiff, copy.data(), y, 0);
      }
    } else {
      TIFFSetField(tiff, TIFFTAG_TILEWIDTH, o.tile);
      TIFFSetField(tiff, TIFFTAG_TILELENGTH, o.tile);
      for (unsigned y = 0; y < height; y += o.tile)
        for (unsigned x = 0; x < width; x += o.tile) {
          Bytes tile(o.tile * o.tile * sample / 8, '\x55');
          for (unsigned r = 0; r < o.tile && y + r < height; ++r)
            tile.replace(r * o.tile * sample / 8, std::min(o.tile, width - x) * sample / 8, page,
                         (y + r) * row + x * sample / 8, std::min(o.tile, width - x) * sample / 8);
          TIFFWriteTile(tiff, tile.data(), x, y, 0, 0);
        }
    }
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
}

namespace {

Bytes dicom_element(unsigned group, unsigned element, const std::string& vr, Bytes value) {
  if (value.size() % 2) value += vr == "UI" ? '\0' : ' ';
  Bytes head = bytes_of(static_cast<std::uint16_t>(group)) + bytes_of(static_cast<std::uint16_t>(element)) + vr;
  if (vr == "OB" || vr == "OW")
    head += Bytes(2, '\0') + bytes_of(static_cast<std::uint32_t>(value.size()));
  else
    head += bytes_of(static_cast<std::uint16_t>(value.size()));
  return head + value;
}

Bytes decimals(std::span<const double> values) {
  Bytes text;
  for (const double v : values) {
    std::array<char, 32> number{};
    std::snprintf(number.data(), number.size(), "%.10g", v);
    text += (text.empty() ? "" : "\\") + std::string(number.data());
  }
  return text;
}

}  // namespace

Bytes dicom_file(const DicomSlice& s) {
  const auto us = [](unsigned v) { return bytes_of(static_cast<std::uint16_t>(v)); };
  static std::atomic<int> instance{0};
  const std::string sop_class = "1.2.840.10008.5.1.4.1.1.4", sop = "1.2.3.4." + std::to_string(++instance);
  const Bytes meta = dicom_element(2, 1, "OB", Bytes("\0\1", 2)) + dicom_element(2, 2, "UI", sop_class) +
                     dicom_element(2, 3, "UI", sop) + dicom_element(2, 0x10, "UI", "1.2.840.10008.1.2.1") +
                     dicom_element(2, 0x12, "UI", "1.2.3.4.5");
  const std::array<double, 2> spacing{s.row_spacing, s.column_spacing};
  Bytes data = dicom_element(8, 0x16, "UI", sop_class) + dicom_element(8, 0x18, "UI", sop) +
               dicom_element(8, 0x60, "CS", "MR") + dicom_element(0x20, 0xd, "UI", "1.2") +
               dicom_element(0x20, 0xe, "UI", s.series) + dicom_element(0x20, 0x32, "DS", decimals(s.position)) +
               dicom_element(0x20, 0x37, "DS", decimals(s.orientation)) + dicom_element(0x28, 2, "US", us(1)) +
               dicom_element(0x28, 4, "CS", "MONOCHROME2") + dicom_element(0x28, 0x10, "US", us(s.rows)) +
               dicom_element(0x28, 0x11, "US", us(s.columns)) + dicom_element(0x28, 0x30, "DS", decimals(spacing)) +
               dicom_element(0x28, 0x100, "US", us(16)) + dicom_element(0x28, 0x101, "US", us(s.stored)) +
               dicom_element(0x28, 0x102, "US", us(s.stored - 1)) +
               dicom_element(0x28, 0x103, "US", us(s.is_signed ? 1 : 0));
  if (!s.slope.empty())
    data += dicom_element(0x28, 0x1052, "DS", s.intercept) + dicom_element(0x28, 0x1053, "DS", s.slope);
  data += dicom_element(0x7fe0, 0x10, "OW", bytes_of_all(s.values));
  return Bytes(128, '\0') + "DICM" + dicom_element(2, 0, "UL", bytes_of(static_cast<std::uint32_t>(meta.size()))) +
         meta + data;
}

std::string error_of(const std::string& path, const ReadOptions& options, ErrorKind kind) {
  const Execution execution(2);
  try {
    read_label_image(path, options, execution);
  } catch (const Error& e) {
    const std::string text = e.what();
    EXPECT_EQ(e.kind(), kind) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_NE(text.find("; "), std::string::npos) << "says not what to do: " << text;
    EXPECT_NE(text.find(std::filesystem::path(path).stem().string()), std::string::npos) << text;
    return text;
  }
  return "";
}

std::vector<std::string> warnings_of(const std::string& path) {
  Execution execution(1);
  std::vector<std::string> warnings;
  execution.on_warning = [&](std::string_view text) { warnings.emplace_back(text); };
  read_label_image(path, {}, execution);
  return warnings;
}

}  // namespace treemarch::testing
