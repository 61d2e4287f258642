// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads this process's memory through the kernel, because another thread can free it at any time: memory that is gone
// is an error and no crash. No state; any thread.
#pragma once

#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>

namespace redag_rclcpp {

/// Reads a file of /proc from `offset`. Returns the number of bytes read; negative: it cannot be read.
[[nodiscard]] inline ssize_t read_file(const char *path, void *buffer, std::size_t size, off_t offset) noexcept {
  const int descriptor = ::open(path, O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return -1;
  const ssize_t count = ::pread(descriptor, buffer, size, offset);
  ::close(descriptor);
  return count;
}

/// Reads up to `size` bytes at `address`. Returns the number of bytes read; negative: there is no such memory.
[[nodiscard]] inline ssize_t read_own_memory(std::uintptr_t address, void *buffer, std::size_t size) noexcept {
  return read_file("/proc/self/mem", buffer, size, static_cast<off_t>(address));
}

}  // namespace redag_rclcpp
