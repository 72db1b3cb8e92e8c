#include "treemarch/core/scratch_memory.h"

#include <fcntl.h>
#include <linux/magic.h>
#include <sys/mman.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <iterator>

#include "treemarch/core/error.h"

namespace treemarch {
namespace {

using namespace std::chrono_literals;

constexpr auto kInterval = 500us;
// What threads may touch between two looks.
constexpr std::int64_t kMargin = std::int64_t{1} << 27;
constexpr std::size_t kMostMapped = std::size_t{1} << 44;  // leaves most of the addresses to others
constexpr std::size_t kGranularity = 64;                   // of extents
constexpr std::size_t kHeader = kGranularity;              // before what is handed out: the bytes of the extent
constexpr std::size_t kStep = std::size_t{1} << 26;        // by which the file grows
constexpr std::size_t kForgotten = std::size_t{1} << 20;   // extents that are worth a call to the system

std::size_t page_bytes() {
  static const auto bytes = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

[[noreturn]] void fail(const std::string& folder, const std::string& what) {
  throw Error(ErrorKind::output, folder + ": " + what + "; name another folder on a disk (--scratch)");
}

int open_unnamed(const std::string& folder) {
  std::string name = folder + "/treemarch-scratch-XXXXXX";
  const int file = ::mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) fail(folder, std::string("holds no file for what exceeds the memory: ") + std::strerror(errno));
  ::unlink(name.c_str());
  return file;
}

/// Bytes of the process in main memory: all of them, and those of files.
struct Resident {
  std::int64_t all = 0, of_files = 0;
};

Resident resident_bytes(int statm) {
  std::array<char, 128> text{};
  const ssize_t n = ::pread(statm, text.data(), text.size(), 0);
  std::array<std::int64_t, 3> pages{};  // mapped, resident, resident and of files
  const char *at = text.data(), *end = at + std::max<ssize_t>(n, 0);
  for (std::int64_t& p : pages) {
    const auto [next, error] = std::from_chars(at, end, p);
    if (error != std::errc{}) return {};
    at = std::min(next + 1, end);
  }
  const auto page = static_cast<std::int64_t>(page_bytes());
  return {pages[1] * page, pages[2] * page};
}

}  // namespace

ScratchMemory::ScratchMemory(const std::string& folder, std::int64_t most_resident) {
  if (!is_on_disk(folder)) fail(folder, "is itself in memory");
  file_ = open_unnamed(folder);
  try {
    map(folder);
    watcher_ = std::jthread([this, most_resident](const std::stop_token& stop) { watch(stop, most_resident); });
  } catch (...) {
    ::close(file_);
    throw;
  }
}

/// Room for all that the disk has, as far as there are addresses. The file grows into it.
void ScratchMemory::map(const std::string& folder) {
  size_ = std::min(static_cast<std::size_t>(free_disk_bytes(folder)), kMostMapped);
  for (; size_ >= kStep; size_ /= 2) {
    void* const mapped = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_NORESERVE, file_, 0);
    if (mapped != MAP_FAILED) {
      begin_ = static_cast<std::byte*>(mapped);
      return;
    }
    if (errno != ENOMEM) fail(folder, std::string("its files cannot be mapped: ") + std::strerror(errno));
  }
  fail(folder, "has no room, or this process no addresses (ulimit -v), for what exceeds the memory");
}

ScratchMemory::~ScratchMemory() {
  watcher_.request_stop();
  watcher_.join();
  ::munmap(begin_, size_);
  ::close(file_);
}

void* ScratchMemory::allocate(std::size_t bytes) noexcept try {
  const std::size_t whole = (bytes + kHeader + kGranularity - 1) / kGranularity * kGranularity;
  std::byte* p = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    if ((by_size_.empty() || by_size_.rbegin()->first < whole) && !reserve(whole)) return nullptr;
    p = begin_ + take(whole);
  }
  std::memcpy(p, &whole, sizeof whole);  // may wait for the disk
  return p + kHeader;
} catch (const std::bad_alloc&) {
  return nullptr;
}

void ScratchMemory::release(void* p) noexcept try {
  std::byte* const begin = static_cast<std::byte*>(p) - kHeader;
  std::size_t bytes = 0;
  std::memcpy(&bytes, begin, sizeof bytes);
  const auto at = static_cast<std::size_t>(begin - begin_);
  // What nobody needs any more need not be written to the disk. Where the folder knows no such thing it is written.
  if (bytes >= kForgotten)
    ::fallocate(file_, FALLOC_FL_ZERO_RANGE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(at), static_cast<off_t>(bytes));
  const std::scoped_lock lock(mutex_);
  give(at, bytes);
} catch (const std::bad_alloc&) {  // the room is not used again
}

/// The first bytes of the smallest free extent that has room, and of several the first one.
std::size_t ScratchMemory::take(std::size_t bytes) {
  const auto best = by_size_.lower_bound({bytes, 0});
  const auto [room, at] = *best;
  by_size_.erase(best);
  free_.erase(at);
  if (room > bytes) {
    free_.emplace(at + bytes, room - bytes);
    by_size_.emplace(room - bytes, at + bytes);
  }
  return at;
}

/// Makes an extent of so many bytes free at the end of the file, if the disk has room.
bool ScratchMemory::reserve(std::size_t bytes) {
  const std::size_t end = reserved_;
  const auto last = free_.empty() ? free_.end() : std::prev(free_.end());
  const std::size_t at_end = last != free_.end() && last->first + last->second == end ? last->second : 0;
  const std::size_t missing = bytes - at_end;
  for (const std::size_t step : {std::max(missing, kStep), missing}) {
    // Without blocks on the disk, writing to a page would end the process.
    if (step > size_ - end || ::posix_fallocate(file_, static_cast<off_t>(end), static_cast<off_t>(step)) != 0)
      continue;
    reserved_ = end + step;
    give(end, step);
    return true;
  }
  return false;
}

/// Joins an extent with what is free on both sides.
void ScratchMemory::give(std::size_t at, std::size_t bytes) {
  auto next = free_.lower_bound(at);
  if (next != free_.end() && at + bytes == next->first) {
    bytes += next->second;
    by_size_.erase({next->second, next->first});
    next = free_.erase(next);
  }
  if (next != free_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == at) {
      by_size_.erase({before->second, before->first});
      at = before->first;
      bytes += before->second;
      free_.erase(before);
    }
  }
  free_.emplace(at, bytes);
  by_size_.emplace(bytes, at);
}

void ScratchMemory::watch(const std::stop_token& stop, std::int64_t most_resident) const {
  constexpr std::int64_t kWorthwhile = 16'000'000;
  const std::int64_t cleared_at = most_resident - std::min(kMargin, most_resident / 2);
  const int statm = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (statm < 0) return;  // it is the system then that decides what stays
  while (!stop.stop_requested()) {
    const Resident resident = resident_bytes(statm);
    // Pages that are in use come back when they are touched; their contents stay with the file.
    if (resident.all > cleared_at && resident.of_files > kWorthwhile)
      ::madvise(begin_, static_cast<std::size_t>(reserved()), MADV_DONTNEED);
    std::this_thread::sleep_for(kInterval);
  }
  ::close(statm);
}

bool is_on_disk(const std::string& folder) {
  struct statfs system {};
  return ::statfs(folder.c_str(), &system) != 0 || (system.f_type != TMPFS_MAGIC && system.f_type != RAMFS_MAGIC);
}

std::int64_t free_disk_bytes(const std::string& folder) {
  struct statfs system {};
  if (::statfs(folder.c_str(), &system) != 0) return 0;
  return static_cast<std::int64_t>(system.f_bavail) * static_cast<std::int64_t>(system.f_frsize);
}

}  // namespace treemarch
