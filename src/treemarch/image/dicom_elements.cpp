#include "treemarch/image/dicom_elements.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

constexpr std::uint32_t kUndefined = 0xffffffffU;
constexpr std::uint32_t kItem = 0xfffee000U, kItemEnd = 0xfffee00dU, kSequenceEnd = 0xfffee0ddU;
constexpr std::uint32_t kTransferSyntax = 0x00020010U, kPixelData = 0x7fe00010U;
constexpr int kDeepest = 32;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw Error(ErrorKind::input, path + ": " + what);
}

struct Syntax {
  bool implicit = false;
  bool big_endian = false;
};

/// Walks over the elements of a file.
class Walker {
 public:
  Walker(const std::string& path, const std::string& bytes) : path_(path), bytes_(bytes) {}

  [[nodiscard]] bool at_end() const { return at_ == bytes_.size(); }
  [[nodiscard]] std::size_t position() const { return at_; }
  void skip(std::size_t n) {
    if (n > bytes_.size() - at_) fail(path_, "is cut short or damaged; get a complete copy");
    at_ += n;
  }
  [[nodiscard]] std::uint32_t peek_tag(bool big_endian) {
    const std::size_t start = at_;
    const std::uint32_t tag = read_tag(big_endian);
    at_ = start;
    return tag;
  }

  struct Head {
    std::uint32_t tag = 0, length = 0;
  };
  Head read_head(const Syntax& syntax) {
    Head head;
    head.tag = read_tag(syntax.big_endian);
    if (syntax.implicit || head.tag >> 16 == 0xfffeU) {
      head.length = read<std::uint32_t>(syntax.big_endian);
      return head;
    }
    const std::size_t kind = at_;
    skip(2);
    const std::string_view vr(bytes_.data() + kind, 2);
    constexpr std::array<std::string_view, 13> kLong{"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                     "SV", "UC", "UN", "UR", "UT", "UV"};
    if (std::find(kLong.begin(), kLong.end(), vr) != kLong.end()) {
      skip(2);
      head.length = read<std::uint32_t>(syntax.big_endian);
    } else {
      const auto letter = [](char c) { return c >= 'A' && c <= 'Z'; };
      if (!letter(vr[0]) || !letter(vr[1]))
        fail(path_, "is damaged (an element has no known type); get a complete copy");
      head.length = read<std::uint16_t>(syntax.big_endian);
    }
    return head;
  }

  /// Skips the value of an element.
  void skip_value(const Head& head, const Syntax& syntax, int depth = 0) {
    if (head.length != kUndefined) {
      skip(head.length);
      return;
    }
    if (depth > kDeepest) fail(path_, "is damaged (sequences are nested too deeply); get a complete copy");
    while (true) {
      const Head item = read_head(syntax);
      if (item.tag == kSequenceEnd) return;
      if (item.tag != kItem) fail(path_, "is damaged (a sequence has no end); get a complete copy");
      if (item.length != kUndefined) {
        skip(item.length);
        continue;
      }
      while (peek_tag(syntax.big_endian) != kItemEnd) skip_value(read_head(syntax), syntax, depth + 1);
      read_head(syntax);
    }
  }

 private:
  template <class T>
  T read(bool big_endian) {
    const std::size_t start = at_;
    skip(sizeof(T));
    T value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      const std::size_t from = big_endian ? i : sizeof(T) - 1 - i;
      value = static_cast<T>(value << 8 | static_cast<unsigned char>(bytes_[start + from]));
    }
    return value;
  }
  std::uint32_t read_tag(bool big_endian) {
    const std::uint32_t group = read<std::uint16_t>(big_endian);
    return group << 16 | read<std::uint16_t>(big_endian);
  }

  const std::string& path_;
  const std::string& bytes_;
  std::size_t at_ = 0;
};

/// The way in which the elements after the first group are written.
Syntax data_syntax(const std::string& path, const std::string& uid, bool& compressed) {
  compressed = false;
  if (uid == "1.2.840.10008.1.2") return {true, false};
  if (uid == "1.2.840.10008.1.2.1") return {false, false};
  if (uid == "1.2.840.10008.1.2.2") return {false, true};
  if (uid == "1.2.840.10008.1.2.1.99" || !uid.starts_with("1.2.840.10008.1.2."))
    fail(path, "uses the transfer syntax '" + uid + "', which is not read; convert it to explicit little endian");
  compressed = true;
  return {false, false};
}

}  // namespace

const DicomElements::Element* DicomElements::find(std::uint32_t tag) const {
  const auto found = std::find_if(elements.begin(), elements.end(), [&](const Element& e) { return e.tag == tag; });
  return found == elements.end() ? nullptr : &*found;
}

std::string DicomElements::text(std::uint32_t tag) const {
  const Element* e = find(tag);
  if (!e) return {};
  std::string value = bytes.substr(e->offset, e->length);
  while (!value.empty() && (value.back() == ' ' || value.back() == '\0')) value.pop_back();
  value.erase(0, value.find_first_not_of(' '));
  return value;
}

std::optional<unsigned> DicomElements::number(std::uint32_t tag) const {
  const Element* e = find(tag);
  if (!e || e->length < 2) return std::nullopt;
  const auto low = static_cast<unsigned char>(bytes[e->offset + (big_endian ? 1 : 0)]);
  const auto high = static_cast<unsigned char>(bytes[e->offset + (big_endian ? 0 : 1)]);
  return static_cast<unsigned>(high << 8 | low);
}

std::vector<double> DicomElements::decimals(std::uint32_t tag) const {
  std::vector<double> values;
  std::istringstream in(text(tag));
  for (std::string part; std::getline(in, part, '\\');) {
    const auto begin = part.find_first_not_of(" +");
    const auto end = part.find_last_not_of(' ');
    double value = 0;
    if (begin == std::string::npos ||
        std::from_chars(part.data() + begin, part.data() + end + 1, value).ptr != part.data() + end + 1)
      return {};
    values.push_back(value);
  }
  return values;
}

DicomElements read_dicom_elements(const std::string& path) {
  DicomElements result;
  std::error_code failed;
  result.bytes.resize(std::filesystem::file_size(path, failed));
  std::ifstream in(path, std::ios::binary);
  if (failed || !in.read(result.bytes.data(), static_cast<std::streamsize>(result.bytes.size())))
    fail(path, "cannot be read; check its permissions");
  if (result.bytes.size() < 132 || result.bytes.compare(128, 4, "DICM") != 0)
    fail(path, "is not a DICOM file (the mark DICM is missing); check the name");

  Walker walker(path, result.bytes);
  walker.skip(132);
  Syntax syntax;
  bool meta = true;
  while (!walker.at_end()) {
    if (meta && walker.peek_tag(false) >> 16 != 2) {
      meta = false;
      syntax = data_syntax(path, result.text(kTransferSyntax), result.compressed);
      result.big_endian = syntax.big_endian;
    }
    const Walker::Head head = walker.read_head(syntax);
    const std::size_t offset = walker.position();
    walker.skip_value(head, syntax);
    result.elements.push_back({head.tag, offset, head.length == kUndefined ? 0 : head.length});
    if (head.tag == kPixelData) return result;
  }
  fail(path, "has no pixel data; it is cut short or is not an image");
}

}  // namespace treemarch
