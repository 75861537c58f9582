// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace evpose {

/// Memory in huge pages where the system grants them, else in ordinary ones. Throws std::bad_alloc.
void* allocate_huge(std::size_t bytes);
void release_huge(void* memory);

template <class T>
struct HugePages {
  using value_type = T;
  HugePages() = default;
  template <class U>
  HugePages(const HugePages<U>&) {}  // NOLINT(google-explicit-constructor): as allocators are
  T* allocate(std::size_t n) { return static_cast<T*>(allocate_huge(n * sizeof(T))); }
  void deallocate(T* memory, std::size_t) { release_huge(memory); }
  bool operator==(const HugePages&) const { return true; }
};

/// For tables of megabytes that are read at random: with ordinary pages each read would look up its page too.
template <class T>
using RandomAccessTable = std::vector<T, HugePages<T>>;

}  // namespace evpose
