/// \file
/// Memory that is free, but still with the process.
#pragma once

namespace treemarch {

/// Gives freed memory back to the system, so that the peak of the process is what is in use at one time. Many small
/// pieces would stay with their allocator otherwise, where one large piece that follows cannot use them.
void give_back_free_memory();

}  // namespace treemarch
