/// \file
/// Output that is whole or absent: written beside its final place, then renamed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace treemarch {

/// A file that appears under its name only after commit(). Destroyed before that, it leaves nothing behind.
class OutputFile {
 public:
  /// \throw Error(output) if the file exists and `overwrite` is false, if the name is that of something else than a
  /// file (a folder, a device), or if its folder cannot be written.
  OutputFile(std::string path, bool overwrite);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Appends. \throw Error(output), for instance when the disk is full.
  void write(const void* data, std::size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// Bytes written so far.
  [[nodiscard]] std::int64_t position() const { return position_; }
  /// Replaces bytes that were written before. \pre at + bytes <= position(). \throw Error(output)
  void write_at(std::int64_t at, const void* data, std::size_t bytes);
  /// Flushes and renames. \throw Error(output)
  void commit();
  /// The name to give to a library that writes the file itself; commit() afterwards.
  [[nodiscard]] const std::string& temporary_path() const { return temporary_; }

 private:
  [[noreturn]] void fail(const char* what) const;
  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
  std::int64_t position_ = 0;
};

}  // namespace treemarch
