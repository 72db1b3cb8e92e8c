#include "memory_limit.h"

#include <malloc.h>
#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <string_view>

#include "treemarch/core/error.h"
#include "treemarch/core/scratch_memory.h"
#include "treemarch/report/estimate.h"

namespace treemarch::app {
namespace {

// Bytes from which on a piece of memory counts. malloc() may give some more than it is asked for.
constexpr std::size_t kCounted = 512, kSlack = 64;

// What a child of this process (image/decompress_dicom.cpp) does must not change what both share.
bool is_child = false;

// A disk may have no room for what was promised, or be damaged.
void on_bus_error(int) {
  constexpr std::string_view kMessage =
      "treemarch: error: --scratch: the disk cannot hold what exceeds --max-memory; name another folder\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kMessage.data(), kMessage.size());
  ::_exit(static_cast<int>(ErrorKind::limits));
}

/// Decides where arrays lie.
class LimitedMemory {
 public:
  LimitedMemory(std::int64_t bytes, const std::string& folder) : most_(bytes), scratch_(folder, bytes) {
    ::mallopt(M_MMAP_THRESHOLD, 1 << 20);  // what is freed goes back to the system
    ::pthread_atfork(nullptr, nullptr, [] { is_child = true; });
    std::signal(SIGBUS, on_bus_error);
  }

  /// Half of the limit is left to what lies in the file, unless that is full.
  void* allocate(std::size_t bytes) noexcept {
    if (is_child) return std::malloc(bytes);
    if (void* const p = allocate_below(most_ / 2, bytes)) return p;
    if (void* const p = scratch_.allocate(bytes)) return p;
    is_full_ = true;
    return allocate_below(most_, bytes);
  }
  void release(void* p) noexcept {
    if (scratch_.owns(p)) {
      if (!is_child) scratch_.release(p);
      return;
    }
    in_memory_.fetch_sub(counted(p), std::memory_order_relaxed);
    std::free(p);
  }
  [[nodiscard]] bool is_full() const { return is_full_; }
  [[nodiscard]] std::int64_t in_file() const { return scratch_.reserved(); }

 private:
  static std::int64_t counted(void* p) {
    const std::size_t bytes = ::malloc_usable_size(p);
    return bytes >= kCounted ? static_cast<std::int64_t>(bytes) : 0;
  }
  void* allocate_below(std::int64_t most, std::size_t bytes) noexcept {
    const auto size = static_cast<std::int64_t>(bytes);
    void* p = nullptr;
    std::int64_t got = 0;
    if (in_memory_.fetch_add(size, std::memory_order_relaxed) + size <= most && (p = std::malloc(bytes)) != nullptr)
      got = counted(p);
    in_memory_.fetch_add(got - size, std::memory_order_relaxed);
    return p;
  }

  const std::int64_t most_;
  std::atomic<std::int64_t> in_memory_{0};  // bytes of pieces that count
  std::atomic<bool> is_full_{false};
  ScratchMemory scratch_;
};

// Never destroyed: what is released last lies in it.
std::atomic<LimitedMemory*> limited{nullptr};

}  // namespace

void add_memory_options(CLI::App& command, MemoryOptions& options) {
  command.add_option("--max-memory", options.most,
                     "Main memory to aim at, as 12GB; what needs more is kept in a file on a disk");
  command.add_option("--scratch", options.scratch,
                     "Folder for that file, which has no name; default: that of the output, else /var/tmp");
}

std::optional<MemoryLimit> memory_limit(const MemoryOptions& options, const std::string& output) {
  constexpr std::int64_t kLeast = 100'000'000;
  if (options.most.empty()) {
    if (options.scratch.empty()) return std::nullopt;
    throw Error(ErrorKind::usage, "--scratch: is for what exceeds --max-memory; give both");
  }
  MemoryLimit limit{parse_bytes(options.most, "--max-memory"), options.scratch};
  if (limit.bytes < kLeast)
    throw Error(ErrorKind::usage, "--max-memory: " + options.most + " is too little; give 100MB or more");
  if (limit.folder.empty()) {
    limit.folder = std::filesystem::path(output).parent_path().string();
    if (limit.folder.empty() && !output.empty()) limit.folder = ".";
    if (limit.folder.empty() || !is_on_disk(limit.folder)) limit.folder = "/var/tmp";
  }
  return limit;
}

void apply(const MemoryLimit& limit) { limited = new LimitedMemory(limit.bytes, limit.folder); }

bool is_scratch_full() {
  const LimitedMemory* const memory = limited;
  return memory && memory->is_full();
}

std::int64_t reserved_scratch_bytes() {
  const LimitedMemory* const memory = limited;
  return memory ? memory->in_file() : 0;
}

}  // namespace treemarch::app

void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
  auto* const memory = bytes + treemarch::app::kSlack < treemarch::app::kCounted
                           ? nullptr
                           : treemarch::app::limited.load(std::memory_order_relaxed);
  return memory ? memory->allocate(bytes) : std::malloc(bytes > 0 ? bytes : 1);
}

void* operator new(std::size_t bytes) {
  if (void* const p = ::operator new(bytes, std::nothrow)) return p;
  throw std::bad_alloc();
}

void operator delete(void* p) noexcept {
  if (p == nullptr) return;
  if (auto* const memory = treemarch::app::limited.load(std::memory_order_relaxed)) return memory->release(p);
  std::free(p);
}

void operator delete(void* p, std::size_t) noexcept { ::operator delete(p); }
void operator delete(void* p, const std::nothrow_t&) noexcept { ::operator delete(p); }
