// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/huge_pages.h"

#include <sys/mman.h>

#include <cstdlib>

namespace evpose {
namespace {
constexpr std::size_t kPage = std::size_t{2} << 20;
constexpr std::size_t kWorthIt = kPage / 2;
}  // namespace

void* allocate_huge(std::size_t bytes) {
  const std::size_t unit = bytes < kWorthIt ? alignof(std::max_align_t) : kPage;
  const std::size_t whole = (bytes + unit - 1) / unit * unit;
  void* const memory = std::aligned_alloc(unit, whole);
  if (memory == nullptr) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
  if (unit == kPage) madvise(memory, whole, MADV_HUGEPAGE);  // a wish; a refusal does no harm
#endif
  return memory;
}

void release_huge(void* memory) { std::free(memory); }

}  // namespace evpose
