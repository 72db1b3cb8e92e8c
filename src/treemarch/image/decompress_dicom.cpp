#include "treemarch/image/decompress_dicom.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <new>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

constexpr std::size_t kMostBytes = 4;  // of a sample

/// Memory that this process shares with its children.
class SharedMemory {
 public:
  explicit SharedMemory(std::size_t bytes)
      : bytes_(bytes), data_(::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {
    if (data_ == MAP_FAILED) throw std::bad_alloc();
  }
  ~SharedMemory() { ::munmap(data_, bytes_); }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  [[nodiscard]] std::byte* data() const { return static_cast<std::byte*>(data_); }

 private:
  std::size_t bytes_;
  void* data_;
};

/// Loads the module, once.
DecodeDicom* find_decoder(const std::string& path) {
  static void* const module = ::dlopen(TREEMARCH_DICOM_MODULE, RTLD_NOW | RTLD_LOCAL);
  void* const decode = module ? ::dlsym(module, kDecodeDicom) : nullptr;
  if (!decode)
    throw Error(ErrorKind::input, path + ": compressed DICOM needs " TREEMARCH_DICOM_MODULE
                                         ", which cannot be loaded; install it, or decompress the file");
  return reinterpret_cast<DecodeDicom*>(decode);
}

/// Decodes in a process of its own: GDCM, as Debian builds it, aborts where a file is not what it expects.
/// \return whether it ended well
bool decode_apart(const std::string& path, DecodeDicom* decode, std::size_t room, const SharedMemory& memory) {
  const pid_t child = ::fork();
  if (child < 0) throw Error(ErrorKind::limits, path + ": no process can be started to decompress it; end some others");
  if (child == 0) {
    std::signal(SIGINT, SIG_DFL);
    if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) {  // what GDCM says is of no use to users
      ::dup2(nowhere, STDOUT_FILENO);
      ::dup2(nowhere, STDERR_FILENO);
    }
    auto* const header = new (memory.data()) DecodedDicom;
    ::_exit(decode(path.c_str(), room, *header, memory.data() + sizeof *header) ? EXIT_SUCCESS : EXIT_FAILURE);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return false;
  return WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS;
}

}  // namespace

DicomPixels decompress_dicom(const std::string& path, std::int64_t pixels) {
  DecodeDicom* const decode = find_decoder(path);
  const auto count = static_cast<std::size_t>(pixels);
  const SharedMemory memory(sizeof(DecodedDicom) + count * kMostBytes);
  if (!decode_apart(path, decode, count * kMostBytes, memory))
    throw Error(ErrorKind::input, path + ": its compressed pixels cannot be read; get a complete copy or convert it");
  const auto& [format, bytes] = *reinterpret_cast<const DecodedDicom*>(memory.data());
  if (bytes != count * (format.bits / 8))
    throw Error(ErrorKind::input,
                path + ": its compressed pixels have another size than its header says; get a complete copy");
  DicomPixels result{format, std::make_unique_for_overwrite<std::byte[]>(bytes)};
  std::copy_n(memory.data() + sizeof(DecodedDicom), bytes, result.samples.get());
  return result;
}

}  // namespace treemarch
