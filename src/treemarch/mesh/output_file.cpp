#include "treemarch/mesh/output_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "treemarch/core/error.h"

namespace treemarch {

OutputFile::OutputFile(std::string path, bool overwrite) : path_(std::move(path)) {
  namespace fs = std::filesystem;
  std::error_code unknown;  // a place that cannot be looked at fails below, when it is opened
  const fs::file_status status = fs::status(path_, unknown);
  if (fs::is_directory(status)) throw Error(ErrorKind::output, path_ + ": is a folder; give a file name");
  if (fs::exists(status) && !fs::is_regular_file(status))
    throw Error(ErrorKind::output, path_ + ": is not a regular file; give another name");
  if (fs::exists(status) && !overwrite)
    throw Error(ErrorKind::output, path_ + ": exists already; give --force to replace it");
  temporary_ = path_ + ".part" + std::to_string(::getpid());
  file_ = std::fopen(temporary_.c_str(), "wb");
  if (!file_) {
    temporary_.clear();
    fail("cannot be written");
  }
}

OutputFile::~OutputFile() {
  if (file_) std::fclose(file_);
  if (!temporary_.empty()) std::remove(temporary_.c_str());
}

void OutputFile::write(const void* data, std::size_t bytes) {
  if (bytes && std::fwrite(data, 1, bytes, file_) != bytes) fail("writing failed");
  position_ += static_cast<std::int64_t>(bytes);
}

void OutputFile::write_at(std::int64_t at, const void* data, std::size_t bytes) {
  if (::fseeko(file_, at, SEEK_SET) != 0 || std::fwrite(data, 1, bytes, file_) != bytes ||
      ::fseeko(file_, 0, SEEK_END) != 0)
    fail("writing failed");
}

void OutputFile::commit() {
  const int closed = std::fclose(file_);
  file_ = nullptr;
  if (closed != 0) fail("writing failed");
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot be put in place");
  temporary_.clear();
}

void OutputFile::fail(const char* what) const {
  const int reason = errno;
  throw Error(ErrorKind::output, path_ + ": " + what + ": " + std::strerror(reason));
}

}  // namespace treemarch
