/// \file
/// A limit for the memory of this process. Beyond it, arrays lie in a file (core/scratch_memory.h).
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

namespace treemarch::app {

/// As a user gives them.
struct MemoryOptions {
  std::string most, scratch;
};

void add_memory_options(CLI::App& command, MemoryOptions& options);

struct MemoryLimit {
  std::int64_t bytes = 0;
  std::string folder;  ///< of the file
};

/// \param output file beside which the file lies by default if that is on a disk; may be empty
/// \throw Error(usage)
std::optional<MemoryLimit> memory_limit(const MemoryOptions& options, const std::string& output);

/// From now on, what operator new is asked for and would bring its sum above half of the limit is kept in the file, of
/// which no more stays in the main memory than the limit leaves room for. To be called once, before there are other
/// threads. \throw Error(output) if the folder cannot hold the file
void apply(const MemoryLimit& limit);

/// Whether the disk had no room for something.
bool is_scratch_full();

/// Bytes that the file has taken of the disk; 0 where nothing exceeded the limit.
std::int64_t reserved_scratch_bytes();

}  // namespace treemarch::app
