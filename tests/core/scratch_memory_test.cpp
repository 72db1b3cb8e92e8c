#include "treemarch/core/scratch_memory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"

namespace treemarch {
namespace {

constexpr std::int64_t kNoLimit = std::int64_t{1} << 60;

/// A folder on a disk: that of the tests, which is where they were built.
const std::string& folder() {
  static const std::string path = std::filesystem::current_path().string();
  return path;
}

class ScratchMemoryTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!is_on_disk(folder())) GTEST_SKIP() << folder() << " is in memory";
  }
};

/// A piece of memory that knows what is in it.
struct Piece {
  unsigned char* begin;
  std::size_t bytes;
  unsigned char value;

  [[nodiscard]] bool is_whole() const {
    for (std::size_t i = 0; i < bytes; ++i)
      if (begin[i] != value) return false;
    return true;
  }
};

/// Takes and gives back pieces in any order; counts those whose contents changed.
int lives(ScratchMemory& memory, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Piece> pieces;
  int damaged = 0;
  for (int step = 0; step < 2000; ++step) {
    if (random() % 2 == 0 || pieces.empty()) {
      const std::size_t bytes = 1 + random() % (random() % 16 == 0 ? 3'000'000 : 10'000);
      auto* const begin = static_cast<unsigned char*>(memory.allocate(bytes));
      if (begin == nullptr || !memory.owns(begin) || reinterpret_cast<std::uintptr_t>(begin) % 16 != 0) return -1;
      const Piece piece{begin, bytes, static_cast<unsigned char>(random())};
      std::memset(begin, piece.value, bytes);
      pieces.push_back(piece);
    } else {
      std::swap(pieces[random() % pieces.size()], pieces.back());
      damaged += pieces.back().is_whole() ? 0 : 1;
      memory.release(pieces.back().begin);
      pieces.pop_back();
    }
  }
  for (const Piece& piece : pieces) {
    damaged += piece.is_whole() ? 0 : 1;
    memory.release(piece.begin);
  }
  return damaged;
}

TEST_F(ScratchMemoryTest, PiecesKeepWhatIsInThemForManyThreads) {
  ScratchMemory memory(folder(), kNoLimit);
  const Execution execution(4);
  std::vector<int> damaged(8, -1);
  parallel_for(execution, std::ssize(damaged), 1,
               [&](std::int64_t i) { damaged[static_cast<std::size_t>(i)] = lives(memory, static_cast<unsigned>(i)); });
  EXPECT_EQ(damaged, std::vector<int>(8, 0));
}

TEST_F(ScratchMemoryTest, WhatIsReleasedIsUsedAgainAsAWhole) {
  ScratchMemory memory(folder(), kNoLimit);
  constexpr std::size_t kPiece = 1'000'000;
  std::vector<void*> pieces;
  for (int i = 0; i < 50; ++i) pieces.push_back(memory.allocate(kPiece));
  const std::int64_t reserved = memory.reserved();
  EXPECT_GE(reserved, 50 * static_cast<std::int64_t>(kPiece));
  // Every other piece first, so that gaps are joined on both sides.
  for (const std::size_t first : {0U, 1U})
    for (std::size_t i = first; i < pieces.size(); i += 2) memory.release(pieces[i]);
  void* const whole = memory.allocate(static_cast<std::size_t>(reserved) - 64);
  EXPECT_NE(whole, nullptr);
  EXPECT_EQ(memory.reserved(), reserved);
  memory.release(whole);
  // What is larger takes no more of the disk than it lacks.
  EXPECT_NE(memory.allocate(static_cast<std::size_t>(reserved) + 100'000'000), nullptr);
  EXPECT_LE(memory.reserved(), reserved + 101'000'000);
}

TEST_F(ScratchMemoryTest, LeavesTheMainMemoryAndComesBack) {
  constexpr std::size_t kBytes = 400'000'000;
  constexpr std::int64_t kMost = 200'000'000;
  ScratchMemory memory(folder(), kMost);
  auto* const piece = static_cast<unsigned char*>(memory.allocate(kBytes));
  ASSERT_NE(piece, nullptr);
  for (std::size_t i = 0; i < kBytes; ++i) piece[i] = static_cast<unsigned char>(i * 7 >> 5);
  const auto resident = [] {
    std::int64_t mapped = 0, pages = 0;
    std::ifstream("/proc/self/statm") >> mapped >> pages;
    return pages * ::sysconf(_SC_PAGESIZE);
  };
  for (int i = 0; i < 1000 && resident() > kMost; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_LE(resident(), kMost);
  std::size_t different = 0;
  for (std::size_t i = 0; i < kBytes; ++i) different += piece[i] != static_cast<unsigned char>(i * 7 >> 5) ? 1 : 0;
  EXPECT_EQ(different, 0U);
}

TEST_F(ScratchMemoryTest, LeavesNothingInTheFolder) {
  const std::filesystem::path place = std::filesystem::path(folder()) / "scratch_memory_test";
  std::filesystem::create_directory(place);
  {
    ScratchMemory memory(place.string(), kNoLimit);
    EXPECT_NE(memory.allocate(10), nullptr);
    EXPECT_TRUE(std::filesystem::is_empty(place));
  }
  EXPECT_TRUE(std::filesystem::remove(place));
}

TEST_F(ScratchMemoryTest, SaysWhatDoesNotFit) {
  ScratchMemory memory(folder(), kNoLimit);
  EXPECT_EQ(memory.allocate(static_cast<std::size_t>(free_disk_bytes(folder())) + (std::size_t{1} << 30)), nullptr);
  EXPECT_EQ(memory.reserved(), 0);
  for (const char* bad : {"/nowhere/at/all", "/dev/shm"}) {  // the second one is memory
    if (bad == std::string("/dev/shm") && !std::filesystem::exists(bad)) continue;
    try {
      const ScratchMemory none(bad, kNoLimit);
      FAIL() << bad;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::output);
      EXPECT_EQ(std::string(e.what()).find(bad), 0U);
    }
  }
  EXPECT_EQ(free_disk_bytes("/nowhere/at/all"), 0);
}

}  // namespace
}  // namespace treemarch
