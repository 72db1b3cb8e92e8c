/// \file
/// Whether one material is met at a place or several, noted by several threads.
#pragma once

#include <atomic>

#include "treemarch/image/label_image.h"

namespace treemarch {

/// What stands where several materials were noted; kOutside stands where none was.
inline constexpr MaterialId kSeveral = kOutside - 1;

/// Notes a material, or kSeveral. The same for any order of the calls.
inline void note_material(MaterialId& mark, MaterialId material) {
  const std::atomic_ref at(mark);
  MaterialId seen = at.load(std::memory_order_relaxed);
  while (seen != material && seen != kSeveral)
    if (at.compare_exchange_weak(seen, seen == kOutside ? material : kSeveral, std::memory_order_relaxed)) break;
}

}  // namespace treemarch
