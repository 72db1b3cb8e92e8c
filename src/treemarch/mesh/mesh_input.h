/// \file
/// What the readers of all formats share.
#pragma once

#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/read_mesh.h"

namespace treemarch {

/// What is wrong with a file, without its name.
class BadFile : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A mesh as a file has it: nothing is checked but that the arrays fit each other.
struct MeshInput {
  struct Cells {
    CellType type{};
    std::vector<std::int64_t> vertices;
    std::vector<std::int32_t> labels;
  };
  std::vector<Vec<3>> points;
  std::vector<Vec<4>> space_time_points;  ///< instead of `points`, for pentatopes
  std::vector<Cells> cells;
  std::vector<std::pair<std::int32_t, std::string>> names;  ///< of labels
  MeshRecord record;

  /// The cells to which one of `type` is to be appended.
  Cells& cells_of(CellType type) {
    if (cells.empty() || cells.back().type != type) cells.push_back({type, {}, {}});
    return cells.back();
  }
};

MeshInput read_vtu(std::string_view file, const Execution& execution);
MeshInput read_msh(std::string_view file);
MeshInput read_medit(std::string_view file);
/// \param text content of the .xdmf. \param path its place, from which its arrays are found.
MeshInput read_xdmf(std::string_view text, const std::string& path);

/// Reads bytes in order and never beyond their end.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : rest_(bytes) {}

  [[nodiscard]] bool at_end() const { return rest_.empty(); }
  [[nodiscard]] std::size_t remaining() const { return rest_.size(); }
  /// \throw BadFile if fewer are left.
  std::string_view take(std::size_t bytes) {
    if (bytes > rest_.size()) throw BadFile("ends too early");
    const std::string_view taken = rest_.substr(0, bytes);
    rest_.remove_prefix(bytes);
    return taken;
  }
  /// A number in the machine's own representation.
  template <class T>
  T binary() {
    T value;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  /// The rest of the line, without its end.
  std::string_view line() {
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    std::string_view text = take(end);
    if (!rest_.empty()) rest_.remove_prefix(1);
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return text;
  }
  /// The next word, past white space and comments that start with #; empty at the end.
  std::string_view word() {
    skip_space();
    std::size_t n = 0;
    while (n < rest_.size() && !is_space(rest_[n])) ++n;
    return take(n);
  }
  /// The next word as a number.
  template <class T>
  T number() {
    const std::string_view text = word();
    T value{};
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    if (result.ec != std::errc() || result.ptr != text.data() + text.size())
      throw BadFile("has \"" + std::string(text.substr(0, 20)) + "\" where a number should be");
    return value;
  }
  /// A count of things that take `bytes_each` at least, so that nothing larger than the file is ever allocated.
  template <class T>
  std::size_t checked_count(T count, std::size_t bytes_each) const {
    if (count < T{0} || static_cast<std::uint64_t>(count) > remaining() / bytes_each)
      throw BadFile("counts more than it can hold");
    return static_cast<std::size_t>(count);
  }
  /// Skips to what follows `text`.
  void skip_past(std::string_view text) {
    const std::size_t at = rest_.find(text);
    if (at == std::string_view::npos) throw BadFile("lacks " + std::string(text));
    rest_.remove_prefix(at + text.size());
  }
  void skip_space() {
    for (;;) {
      while (!rest_.empty() && is_space(rest_.front())) rest_.remove_prefix(1);
      if (rest_.empty() || rest_.front() != '#') return;
      line();
    }
  }
  [[nodiscard]] char peek() const { return rest_.empty() ? '\0' : rest_.front(); }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; }
  std::string_view rest_;
};

}  // namespace treemarch
