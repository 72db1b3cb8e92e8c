#include "memory_limit.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <new>

#include "treemarch/core/error.h"
#include "treemarch/core/scratch_memory.h"
#include "treemarch/report/estimate.h"

namespace treemarch::app {
namespace {

// What is smaller is neither moved nor counted. Sizes that malloc() rounds up to this or beyond are asked for with as
// much.
constexpr std::size_t kLarge = 505;

/// Decides where arrays lie.
class LimitedMemory {
 public:
  LimitedMemory(std::int64_t bytes, const std::string& folder) : most_in_memory_(bytes / 2), scratch_(folder, bytes) {
    ::mallopt(M_MMAP_THRESHOLD, 1 << 20);  // what is freed goes back to the system
  }

  void* allocate(std::size_t bytes) noexcept {
    const auto size = static_cast<std::int64_t>(bytes);
    if (in_memory_.fetch_add(size, std::memory_order_relaxed) + size > most_in_memory_) {
      in_memory_.fetch_sub(size, std::memory_order_relaxed);
      return scratch_.allocate(bytes);
    }
    void* p = std::malloc(bytes);
    const std::size_t got = p ? ::malloc_usable_size(p) : 0;
    in_memory_.fetch_add(static_cast<std::int64_t>(got) - size, std::memory_order_relaxed);
    return p;
  }
  void release(void* p) noexcept {
    if (scratch_.owns(p)) return scratch_.release(p);
    if (const std::size_t size = ::malloc_usable_size(p); size >= kLarge)
      in_memory_.fetch_sub(static_cast<std::int64_t>(size), std::memory_order_relaxed);
    std::free(p);
  }
  [[nodiscard]] std::int64_t in_file() const { return scratch_.reserved(); }

 private:
  const std::int64_t most_in_memory_;
  std::atomic<std::int64_t> in_memory_{0};  // bytes of large arrays
  ScratchMemory scratch_;
};

// Never destroyed: what is released last lies in it.
std::atomic<LimitedMemory*> limited{nullptr};

}  // namespace

void add_memory_options(CLI::App& command, MemoryOptions& options) {
  command.add_option("--max-memory", options.most, "Main memory to use, as 12GB; what needs more is kept in a file");
  command.add_option("--scratch", options.scratch,
                     "Folder on a disk for that file, which has no name; default: that of -o, or /var/tmp");
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

std::int64_t reserved_scratch_bytes() {
  const LimitedMemory* const memory = limited;
  return memory ? memory->in_file() : 0;
}

}  // namespace treemarch::app

void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
  auto* const memory =
      bytes < treemarch::app::kLarge ? nullptr : treemarch::app::limited.load(std::memory_order_relaxed);
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
