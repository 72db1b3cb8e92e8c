#include "treemarch/mesh/output_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "treemarch/core/error.h"

namespace treemarch {

OutputFile::OutputFile(std::string path, bool overwrite) : path_(std::move(path)) {
  if (!overwrite && std::filesystem::exists(path_))
    throw Error(ErrorKind::output, path_ + ": exists already; give --force to replace it");
  if (std::filesystem::is_directory(path_)) throw Error(ErrorKind::output, path_ + ": is a folder; give a file name");
  temporary_ = path_ + ".part" + std::to_string(::getpid());
  file_ = std::fopen(temporary_.c_str(), "wb");
  if (!file_) fail("cannot be written");
}

OutputFile::~OutputFile() {
  if (file_) std::fclose(file_);
  if (!temporary_.empty()) std::remove(temporary_.c_str());
}

void OutputFile::write(const void* data, std::size_t bytes) {
  if (bytes && std::fwrite(data, 1, bytes, file_) != bytes) fail("writing failed");
}

void OutputFile::commit() {
  const int closed = std::fclose(file_);
  file_ = nullptr;
  if (closed != 0) fail("writing failed");
  if (std::rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot be put in place");
  temporary_.clear();
}

void OutputFile::fail(const char* what) const {
  throw Error(ErrorKind::output, path_ + ": " + what + ": " + std::strerror(errno));
}

}  // namespace treemarch
