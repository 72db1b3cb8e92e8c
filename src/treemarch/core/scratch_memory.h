/// \file
/// Memory on a disk: what does not fit beside the rest of a process.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

namespace treemarch {

/// Memory that the system keeps in a file where it is short of room. The file has no name, so that it goes with the
/// process however that ends. Whatever lies here is read and written like any other memory; only its speed depends on
/// what is in use at one time. Functions are safe to call from many threads.
class ScratchMemory {
 public:
  /// \param folder on a disk; what is free there is the most that can be held
  /// \param most_resident bytes of the whole process above which what lies here leaves the main memory
  /// \throw Error(output) if the folder cannot hold the file or is itself in memory
  ScratchMemory(const std::string& folder, std::int64_t most_resident);
  ~ScratchMemory();
  ScratchMemory(const ScratchMemory&) = delete;
  ScratchMemory& operator=(const ScratchMemory&) = delete;

  /// \return memory for any type without an alignment of its own, or nullptr where the disk is full; allocations from
  /// then on may still find what was released
  [[nodiscard]] void* allocate(std::size_t bytes) noexcept;
  [[nodiscard]] bool owns(const void* p) const noexcept {
    const auto at = static_cast<const std::byte*>(p);
    return at >= begin_ && at < begin_ + size_;
  }
  /// \pre p came from allocate() and was not released since
  void release(void* p) noexcept;
  /// Bytes of the disk that are taken, the most so far.
  [[nodiscard]] std::int64_t reserved() const { return static_cast<std::int64_t>(reserved_.load()); }

 private:
  using Extents = std::map<std::size_t, std::size_t>;  // bytes by first byte

  void map(const std::string& folder);
  std::size_t take(std::size_t bytes);
  [[nodiscard]] bool reserve(std::size_t bytes);
  void give(std::size_t at, std::size_t bytes);
  void watch(const std::stop_token& stop, std::int64_t most_resident) const;

  int file_ = -1;
  std::byte* begin_ = nullptr;
  std::size_t size_ = 0;                                   // of what is mapped
  std::mutex mutex_;                                       // for all that follows
  std::atomic<std::size_t> reserved_{0};                   // read without it
  Extents free_;                                           // of what is reserved; no two touch
  std::set<std::pair<std::size_t, std::size_t>> by_size_;  // the same as bytes and first byte
  std::jthread watcher_;                                   // last: ends before what it looks at
};

/// Whether files in a folder, which exists, lie on a disk and not in memory.
bool is_on_disk(const std::string& folder);

/// Bytes that files written to a folder may still take; 0 if the system does not tell.
std::int64_t free_disk_bytes(const std::string& folder);

}  // namespace treemarch
