/// \file
/// A limit for the memory of this process. Beyond it, large arrays lie in a file (core/scratch_memory.h).
#pragma once

#include <cstdint>
#include <string>

namespace treemarch::app {

/// From now on, what operator new is asked for and would bring its sum above half of the limit is kept in a file in a
/// folder, of which no more stays in the main memory than the limit leaves room for. To be called once, before there
/// are other threads.
/// \throw Error(output) if the folder cannot hold the file
void limit_memory(std::int64_t bytes, const std::string& folder);

/// Bytes that the file has taken of the disk; 0 where nothing exceeded the limit.
std::int64_t reserved_scratch_bytes();

}  // namespace treemarch::app
