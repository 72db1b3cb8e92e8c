#include "memory_limit.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "treemarch/core/scratch_memory.h"

namespace treemarch::app {
namespace {

constexpr std::size_t kLarge = 512;

/// Decides where large arrays lie.
class MemoryLimit {
 public:
  MemoryLimit(std::int64_t bytes, const std::string& folder)
      : most_in_memory_(bytes / 2), scratch_(folder, bytes) {
    ::mallopt(M_MMAP_THRESHOLD, 1 << 20);  // what is freed goes back to the system
  }

  void* allocate(std::size_t bytes) {
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
std::atomic<MemoryLimit*> limit{nullptr};

}  // namespace

void limit_memory(std::int64_t bytes, const std::string& folder) { limit = new MemoryLimit(bytes, folder); }

std::int64_t reserved_scratch_bytes() {
  const MemoryLimit* const active = limit;
  return active ? active->in_file() : 0;
}

}  // namespace treemarch::app

void* operator new(std::size_t bytes) {
  using treemarch::app::limit;
  if (bytes >= treemarch::app::kLarge)
    if (auto* const active = limit.load(std::memory_order_relaxed)) {
      if (void* const p = active->allocate(bytes)) return p;
      throw std::bad_alloc();
    }
  if (void* const p = std::malloc(bytes > 0 ? bytes : 1)) return p;
  throw std::bad_alloc();
}

void operator delete(void* p) noexcept {
  if (p == nullptr) return;
  if (auto* const active = treemarch::app::limit.load(std::memory_order_relaxed)) return active->release(p);
  std::free(p);
}

void operator delete(void* p, std::size_t) noexcept { ::operator delete(p); }
