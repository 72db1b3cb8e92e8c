#include "treemarch/image/read_tiff.h"

#include <tiffio.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>

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

/// Thumbnails and masks are pages too, but not part of the image.
bool is_image_page(const TiffFile& tiff) {
  return (tiff.tag(TIFFTAG_SUBFILETYPE, 0) & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0;
}

/// Goes to the first page that is part of the image, or to the next one. False after the last.
bool to_page(const TiffFile& tiff, bool first) {
  bool there = (first ? TIFFSetDirectory(tiff, 0) : TIFFReadDirectory(tiff)) == 1;
  if (first && !there) tiff.damaged();
  while (there && !is_image_page(tiff)) there = TIFFReadDirectory(tiff) == 1;
  if (!there && tiff.complained()) tiff.damaged();  // the list of pages ended, but not well
  return there;
}

/// Page by page, rows of tiles or single rows at a time. One walk along the list of pages: going to a page by its
/// number would walk it again for each.
class TiffSamples : public SampleStream {
 public:
  TiffSamples(std::unique_ptr<TiffFile> tiff, const Page& page)
      : tiff_(std::move(tiff)), page_(page), y_(page.height) {}
  void read(std::byte* to, std::size_t bytes) override {
    while (bytes > 0) {
      if (at_ == band_.size()) next_band();
      const std::size_t n = std::min(bytes, band_.size() - at_);
      to = std::copy_n(band_.data() + at_, n, to);
      at_ += n;
      bytes -= n;
    }
  }

 private:
  void next_band() {
    if (y_ == page_.height) {
      if (!to_page(*tiff_, std::exchange(first_, false))) tiff_->damaged();
      y_ = 0;
    }
    at_ = 0;
    if (TIFFIsTiled(*tiff_))
      read_tiles();
    else
      read_row();
    if (tiff_->complained()) tiff_->damaged();
  }
  void resize_band(std::int64_t rows) {
    band_.resize(static_cast<std::size_t>(rows * page_.width) * sample_bytes(page_.type));
  }
  void read_tiles();
  void read_row();

  std::unique_ptr<TiffFile> tiff_;
  Page page_;
  bool first_ = true;
  std::int64_t y_;               // the next row of the page
  std::vector<std::byte> band_;  // whole rows
  std::size_t at_ = 0;           // bytes of it that were given
  std::vector<std::byte> stored_;
};

void TiffSamples::read_tiles() {
  const std::int64_t width = tiff_->tag(TIFFTAG_TILEWIDTH, 0), height = tiff_->tag(TIFFTAG_TILELENGTH, 0);
  const tmsize_t bytes = TIFFTileSize(*tiff_), row_bytes = TIFFTileRowSize(*tiff_);
  // Tiles may be larger than the page, but not without limit: a damaged file must not exhaust the memory.
  if (width < 1 || height < 1 || bytes <= 0 || row_bytes <= 0 || bytes > (std::int64_t{1} << 31)) tiff_->damaged();
  stored_.resize(static_cast<std::size_t>(bytes));
  const std::int64_t rows = std::min(height, page_.height - y_);
  const auto sample = static_cast<std::int64_t>(sample_bytes(page_.type));
  resize_band(rows);
  for (std::int64_t x = 0; x < page_.width; x += width) {
    const auto index = TIFFComputeTile(*tiff_, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y_), 0, 0);
    if (TIFFReadEncodedTile(*tiff_, index, stored_.data(), bytes) != bytes) tiff_->damaged();
    for (std::int64_t row = 0; row < rows; ++row)
      copy_row(stored_.data() + row * row_bytes, page_.bits, std::min(width, page_.width - x),
               band_.data() + (row * page_.width + x) * sample);
  }
  y_ += rows;
}

void TiffSamples::read_row() {
  const std::int64_t bytes = TIFFScanlineSize64(*tiff_);
  if (bytes < (page_.width * page_.bits + 7) / 8) tiff_->damaged();
  stored_.resize(static_cast<std::size_t>(bytes));
  resize_band(1);
  if (TIFFReadScanline(*tiff_, stored_.data(), static_cast<std::uint32_t>(y_), 0) != 1) tiff_->damaged();
  copy_row(stored_.data(), page_.bits, page_.width, band_.data());
  ++y_;
}

}  // namespace

RawImage read_tiff(const std::string& path) {
  auto tiff = std::make_unique<TiffFile>(path);
  std::int64_t pages = 0;
  Page first;
  for (bool there = to_page(*tiff, true); there; there = to_page(*tiff, false)) {
    const Page page = read_page_header(path, *tiff);
    if (pages == 0) first = page;
    ++pages;
    if (!(page == first))
      fail(path, "page " + std::to_string(pages) + " differs in size or type from the first; split the file");
  }
  if (pages == 0) fail(path, "has no page with an image; check the file");
  RawImage image;
  image.dim = pages > 1 ? 3 : 2;
  image.extent = {first.width, first.height, pages};
  image.type = first.type;
  image.has_spacing = false;
  check_size(path, image.extent, sample_bytes(image.type), static_cast<std::int64_t>(std::filesystem::file_size(path)),
             kTiffRatio);
  image.samples = std::make_unique<TiffSamples>(std::move(tiff), first);
  return image;
}

}  // namespace treemarch
