/// \file
/// Vectors for results that several threads fill.
#pragma once

#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace treemarch {

/// Leaves what is made without a value as it is. A vector that grows to its final size before threads fill it would
/// otherwise be written twice, the first time by one thread alone.
template <class T>
struct RawAllocator : std::allocator<T> {
  template <class U>
  struct rebind {  // NOLINT(readability-identifier-naming): the standard says so
    using other = RawAllocator<U>;
  };
  RawAllocator() = default;
  template <class U>
  RawAllocator(const RawAllocator<U>&) noexcept {}

  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }
};

/// A std::vector but for this: RawVector<T>(n) and resize(n) do not set new elements of trivial types.
template <class T>
using RawVector = std::vector<T, RawAllocator<T>>;

}  // namespace treemarch
