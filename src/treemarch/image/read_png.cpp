#include "treemarch/image/read_png.h"

#include <png.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

/// libpng's handle, file and buffers. It leaves by longjmp, so everything that has a destructor lives here, outside the
/// functions that it jumps out of.
struct Decoder {
  std::FILE* file = nullptr;
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::string message;
  std::vector<png_bytep> rows;

  explicit Decoder(const std::string& path) : file(std::fopen(path.c_str(), "rb")) {
    if (!file) fail(path, "cannot be opened; check that it exists and may be read");
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    if (png) info = png_create_info_struct(png);
  }
  ~Decoder() {
    png_destroy_read_struct(&png, &info, nullptr);
    std::fclose(file);
  }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  static void on_error(png_structp png, png_const_charp text) {
    static_cast<Decoder*>(png_get_error_ptr(png))->message = text;
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}
};

/// Up to the first sample. False after an error.
bool read_header(Decoder& d) {
  if (setjmp(png_jmpbuf(d.png))) return false;
  png_init_io(d.png, d.file);
  png_read_info(d.png, d.info);
  return true;
}

bool read_samples(Decoder& d) {
  if (setjmp(png_jmpbuf(d.png))) return false;
  png_set_packing(d.png);                                           // to whole bytes, values unchanged
  if (png_get_bit_depth(d.png, d.info) == 16) png_set_swap(d.png);  // PNG is big endian
  png_set_interlace_handling(d.png);
  png_read_update_info(d.png, d.info);
  png_read_image(d.png, d.rows.data());
  png_read_end(d.png, nullptr);
  return true;
}

}  // namespace

RawImage read_png(const std::string& path) {
  Decoder decoder(path);
  const auto damaged = [&] {
    fail(path, "cannot be read as PNG (" + decoder.message + "); the file is damaged or cut short");
  };
  if (!decoder.info) throw Error(ErrorKind::limits, path + ": no memory to read it; close other programs");
  if (!read_header(decoder)) damaged();
  const int color = png_get_color_type(decoder.png, decoder.info);
  if (color == PNG_COLOR_TYPE_PALETTE)
    fail(path, "is a palette picture, whose colours need not be labels; convert it to grey values");
  if (color == PNG_COLOR_TYPE_GRAY_ALPHA) fail(path, "has an alpha channel; convert it to plain grey values");
  if (color != PNG_COLOR_TYPE_GRAY)
    fail(path, "is a colour (RGB) picture; give an image with one label or grey value a pixel");

  RawImage image;
  image.dim = 2;
  image.extent = {png_get_image_width(decoder.png, decoder.info), png_get_image_height(decoder.png, decoder.info), 1};
  image.type = png_get_bit_depth(decoder.png, decoder.info) == 16 ? SampleType::u16 : SampleType::u8;
  image.has_spacing = false;
  const int bits = png_get_bit_depth(decoder.png, decoder.info);
  check_size(path, std::span(image.extent).first(2), sample_bytes(image.type),
             static_cast<std::int64_t>(std::filesystem::file_size(path)), kDeflateRatio * (bits < 8 ? 8.0 / bits : 1));
  auto* const data = reinterpret_cast<png_bytep>(image.allocate());
  const std::size_t row_bytes = static_cast<std::size_t>(image.extent[0]) * sample_bytes(image.type);
  for (std::int64_t y = 0; y < image.extent[1]; ++y)
    decoder.rows.push_back(data + static_cast<std::size_t>(y) * row_bytes);
  if (!read_samples(decoder)) damaged();
  return image;
}

}  // namespace treemarch
