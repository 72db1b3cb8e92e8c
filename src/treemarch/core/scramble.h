/// \file
/// Numbers that look random and are the same everywhere.
#pragma once

#include <cstdint>

namespace treemarch {

/// A bijection without a pattern (the finaliser of SplitMix64; Steele, Lea and Flood 2014). 0 stays 0.
inline std::uint64_t scramble(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

}  // namespace treemarch
