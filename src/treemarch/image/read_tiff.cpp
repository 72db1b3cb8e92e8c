#include "treemarch/image/read_tiff.h"

#include <tiffio.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

/// LZW codes of 12 bits stand for at most 4096 bytes; fax codes reach more, but for bits.
constexpr double kTiffRatio = 4000;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// An open file and the first thing that libtiff complained about.
class TiffFile {
 public:
  explicit TiffFile(const std::string& path) : path_(path) {
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                               TIFFOpenOptionsFree);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_error, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), on_warning, nullptr);
    tiff_ = TIFFOpenExt(path.c_str(), "rm", options.get());  // m: no memory mapping, a file may shrink meanwhile
    if (!tiff_) damaged();
  }
  ~TiffFile() {
    if (tiff_) TIFFClose(tiff_);
  }
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  operator TIFF*() const { return tiff_; }
  [[noreturn]] void damaged() const {
    fail(path_, "cannot be read as TIFF" + (message_.empty() ? "" : " (" + message_ + ")") +
                    "; the file is damaged or cut short");
  }
  [[nodiscard]] bool complained() const { return !message_.empty(); }
  [[nodiscard]] std::uint32_t tag(std::uint32_t which, std::uint32_t otherwise) const {
    std::uint16_t small = 0;
    std::uint32_t large = 0;
    if (which == TIFFTAG_IMAGEWIDTH || which == TIFFTAG_IMAGELENGTH || which == TIFFTAG_SUBFILETYPE ||
        which == TIFFTAG_TILEWIDTH || which == TIFFTAG_TILELENGTH)
      return TIFFGetField(tiff_, which, &large) ? large : otherwise;
    return TIFFGetFieldDefaulted(tiff_, which, &small) ? small : otherwise;
  }

 private:
  static int on_error(TIFF*, void* self, const char*, const char* format, va_list arguments) {
    auto& message = static_cast<TiffFile*>(self)->message_;
    if (message.empty()) {
      std::array<char, 200> text{};
      std::vsnprintf(text.data(), text.size(), format, arguments);
      message = text.data();
      std::replace(message.begin(), message.end(), '\n', ' ');
    }
    return 1;
  }
  static int on_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

  std::string path_;
  std::string message_;
  TIFF* tiff_ = nullptr;
};

/// How the samples of a page are stored.
struct Page {
  std::int64_t width = 0, height = 0;
  unsigned bits = 0;
  SampleType type = SampleType::u8;

  bool operator==(const Page&) const = default;
};

SampleType sample_type(const std::string& path, unsigned bits, unsigned format) {
  const bool is_signed = format == SAMPLEFORMAT_INT;
  if (format == SAMPLEFORMAT_IEEEFP) {
    if (bits == 32) return SampleType::f32;
    if (bits == 64) return SampleType::f64;
  } else if (format == SAMPLEFORMAT_UINT || format == SAMPLEFORMAT_INT || format == SAMPLEFORMAT_VOID) {
    if (bits == 8) return is_signed ? SampleType::i8 : SampleType::u8;
    if (bits == 16) return is_signed ? SampleType::i16 : SampleType::u16;
    if (bits == 32) return is_signed ? SampleType::i32 : SampleType::u32;
    if (bits == 64) return is_signed ? SampleType::i64 : SampleType::u64;
    if ((bits == 1 || bits == 2 || bits == 4) && !is_signed) return SampleType::u8;
  }
  fail(path, "has samples of " + std::to_string(bits) + " bits in format " + std::to_string(format) +
                 "; convert it to an integer type of 8 to 64 bits or to float");
}

Page read_page_header(const std::string& path, const TiffFile& tiff) {
  const std::uint32_t photometric = tiff.tag(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  if (photometric == PHOTOMETRIC_PALETTE)
    fail(path, "is a palette picture, whose colours need not be labels; convert it to grey values");
  if (photometric != PHOTOMETRIC_MINISBLACK && photometric != PHOTOMETRIC_MINISWHITE)
    fail(path, "is a colour (RGB) picture; give an image with one label or grey value a pixel");
  const std::uint32_t samples = tiff.tag(TIFFTAG_SAMPLESPERPIXEL, 1);
  if (samples != 1)
    fail(path,
         "has " + std::to_string(samples) + " values a pixel; give an image with one label or grey value a pixel");
  Page page;
  page.width = tiff.tag(TIFFTAG_IMAGEWIDTH, 0);
  page.height = tiff.tag(TIFFTAG_IMAGELENGTH, 0);
  page.bits = tiff.tag(TIFFTAG_BITSPERSAMPLE, 1);
  page.type = sample_type(path, page.bits, tiff.tag(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT));
  return page;
}

/// Copies samples of a decoded row to whole bytes; those of less than 8 bits are packed, the first in the high bits.
void copy_row(const std::byte* in, unsigned bits, std::int64_t count, std::byte* out) {
  if (bits >= 8) {
    std::memcpy(out, in, static_cast<std::size_t>(count) * (bits / 8));
    return;
  }
  const unsigned per_byte = 8 / bits;
  for (std::int64_t i = 0; i < count; ++i) {
    const auto packed = std::to_integer<unsigned>(in[i / per_byte]);
    const unsigned shift = 8 - bits * (static_cast<unsigned>(i % per_byte) + 1);
    out[i] = static_cast<std::byte>(packed >> shift & ((1U << bits) - 1));
  }
}

void read_tiles(const TiffFile& tiff, const Page& page, std::byte* out) {
  const std::int64_t tile_width = tiff.tag(TIFFTAG_TILEWIDTH, 0), tile_height = tiff.tag(TIFFTAG_TILELENGTH, 0);
  const tmsize_t bytes = TIFFTileSize(tiff), row_bytes = TIFFTileRowSize(tiff);
  // Tiles may be larger than the page, but not without limit: a damaged file must not exhaust the memory.
  if (tile_width < 1 || tile_height < 1 || bytes <= 0 || row_bytes <= 0 || bytes > (std::int64_t{1} << 31))
    tiff.damaged();
  std::vector<std::byte> tile(static_cast<std::size_t>(bytes));
  const auto sample = static_cast<std::int64_t>(sample_bytes(page.type));
  for (std::int64_t y = 0; y < page.height; y += tile_height)
    for (std::int64_t x = 0; x < page.width; x += tile_width) {
      const auto index = TIFFComputeTile(tiff, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 0, 0);
      if (TIFFReadEncodedTile(tiff, index, tile.data(), bytes) != bytes) tiff.damaged();
      for (std::int64_t row = 0; row < std::min(tile_height, page.height - y); ++row)
        copy_row(tile.data() + row * row_bytes, page.bits, std::min(tile_width, page.width - x),
                 out + ((y + row) * page.width + x) * sample);
    }
}

void read_rows(const TiffFile& tiff, const Page& page, std::byte* out) {
  const std::int64_t bytes = TIFFScanlineSize64(tiff);
  const auto sample = static_cast<std::int64_t>(sample_bytes(page.type));
  if (bytes < (page.width * page.bits + 7) / 8) tiff.damaged();
  std::vector<std::byte> row(static_cast<std::size_t>(bytes));
  for (std::int64_t y = 0; y < page.height; ++y) {
    if (TIFFReadScanline(tiff, row.data(), static_cast<std::uint32_t>(y), 0) != 1) tiff.damaged();
    copy_row(row.data(), page.bits, page.width, out + y * page.width * sample);
  }
}

/// Thumbnails and masks are pages too, but not part of the image.
bool is_image_page(const TiffFile& tiff) {
  return (tiff.tag(TIFFTAG_SUBFILETYPE, 0) & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0;
}

/// Calls f() at each page that is part of the image, in order. One walk along the list of pages: going to a page by its
/// number would walk it again for each.
template <class F>
void for_each_page(const TiffFile& tiff, F&& f) {
  if (TIFFSetDirectory(tiff, 0) != 1) tiff.damaged();
  do {
    if (is_image_page(tiff)) f();
  } while (TIFFReadDirectory(tiff) == 1);
  if (tiff.complained()) tiff.damaged();  // the list ended, but not well
}

}  // namespace

RawImage read_tiff(const std::string& path) {
  const TiffFile tiff(path);
  std::int64_t pages = 0;
  Page first;
  for_each_page(tiff, [&] {
    const Page page = read_page_header(path, tiff);
    if (pages == 0) first = page;
    ++pages;
    if (!(page == first))
      fail(path, "page " + std::to_string(pages) + " differs in size or type from the first; split the file");
  });
  if (pages == 0) fail(path, "has no page with an image; check the file");
  RawImage image;
  image.dim = pages > 1 ? 3 : 2;
  image.extent = {first.width, first.height, pages};
  image.type = first.type;
  image.has_spacing = false;
  check_size(path, image.extent, sample_bytes(image.type), static_cast<std::int64_t>(std::filesystem::file_size(path)),
             kTiffRatio);
  image.allocate(path);
  std::byte* out = image.data.get();
  for_each_page(tiff, [&] {
    if (TIFFIsTiled(tiff))
      read_tiles(tiff, first, out);
    else
      read_rows(tiff, first, out);
    out += first.width * first.height * static_cast<std::int64_t>(sample_bytes(first.type));
  });
  return image;
}

}  // namespace treemarch
