// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/allocation_counter.hpp"

#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <new>

namespace {

thread_local std::uint64_t allocations = 0;
thread_local std::int64_t live_bytes = 0;
thread_local std::int64_t most_live_bytes = 0;

void *noted(void *memory) {
  ++allocations;
  live_bytes += static_cast<std::int64_t>(::malloc_usable_size(memory));
  most_live_bytes = std::max(most_live_bytes, live_bytes);
  return memory;
}

void *counted(std::size_t size) {
  if (void *memory = noted(std::malloc(size == 0 ? 1 : size))) return memory;
  throw std::bad_alloc();
}

void *counted(std::size_t size, std::align_val_t alignment) {
  const auto boundary = static_cast<std::size_t>(alignment);
  if (void *memory = noted(std::aligned_alloc(boundary, (size + boundary - 1) / boundary * boundary))) return memory;
  throw std::bad_alloc();
}

void release(void *memory) {
  live_bytes -= static_cast<std::int64_t>(::malloc_usable_size(memory));
  std::free(memory);
}

}  // namespace

namespace redag::testing {

std::uint64_t allocation_count() { return allocations; }

PeakMemory::PeakMemory() : before_(live_bytes) { most_live_bytes = live_bytes; }
std::int64_t PeakMemory::bytes() const { return most_live_bytes - before_; }

}  // namespace redag::testing

void *operator new(std::size_t size) { return counted(size); }
void *operator new[](std::size_t size) { return counted(size); }
void *operator new(std::size_t size, std::align_val_t alignment) { return counted(size, alignment); }
void *operator new[](std::size_t size, std::align_val_t alignment) { return counted(size, alignment); }
void *operator new(std::size_t size, const std::nothrow_t &) noexcept {
  return noted(std::malloc(size == 0 ? 1 : size));
}
void *operator new[](std::size_t size, const std::nothrow_t &) noexcept {
  return noted(std::malloc(size == 0 ? 1 : size));
}
void operator delete(void *memory) noexcept { release(memory); }
void operator delete[](void *memory) noexcept { release(memory); }
void operator delete(void *memory, std::size_t) noexcept { release(memory); }
void operator delete[](void *memory, std::size_t) noexcept { release(memory); }
void operator delete(void *memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void *memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void *memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void *memory, std::size_t, std::align_val_t) noexcept { release(memory); }
