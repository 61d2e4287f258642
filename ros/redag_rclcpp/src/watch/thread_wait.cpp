// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/thread_wait.hpp"

#include <sys/syscall.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <future>
#include <memory>

#include "watch/own_memory.hpp"

namespace redag_rclcpp {
namespace {

/// The first word of the state that a promise shares with its futures: the address of the table of the state's virtual
/// functions. It is the same for promises of all types in a process, and no other object that threads wait for has it.
const void *find_mark_of_promises() {
  std::promise<void> promise;
  const std::future<void> future = promise.get_future();
  // libstdc++: a future consists of a shared pointer to the state, which begins with the state's address.
  static_assert(sizeof(future) == sizeof(std::shared_ptr<void>));
  const void *state = nullptr;
  std::copy_n(reinterpret_cast<const std::byte *>(&future), sizeof(state), reinterpret_cast<std::byte *>(&state));
  const void *mark = nullptr;
  std::memcpy(&mark, state, sizeof(mark));
  return mark;
}

/// `word`: the futex for which a thread waits. In libstdc++ it follows two pointers at the beginning of the state. The
/// memory is read by the kernel, because the state can be freed at any time.
bool belongs_to_promise(std::uintptr_t word) noexcept {
  constexpr std::uintptr_t kBefore = 2 * sizeof(void *);
  if (word < kBefore) return false;
  static const void *const kMark = find_mark_of_promises();
  const void *first = nullptr;
  const ssize_t count = read_own_memory(word - kBefore, &first, sizeof(first));
  return count == static_cast<ssize_t>(sizeof(first)) && first == kMark;
}

}  // namespace

ThreadWait wait_of_thread(int thread) noexcept {
  std::array<char, 64> path{};
  std::snprintf(path.data(), path.size(), "/proc/self/task/%d/syscall", thread);
  // "running"; or the number of the system call and its arguments; or -1: the thread waits elsewhere in the kernel.
  std::array<char, 256> text{};
  const ssize_t count = read_file(path.data(), text.data(), text.size() - 1, 0);
  if (count <= 0) return ThreadWait::Unknown;
  if (std::strncmp(text.data(), "running", 7) == 0) return ThreadWait::None;
  char *rest = nullptr;
  const long number = std::strtol(text.data(), &rest, 10);
  if (number != SYS_futex) return ThreadWait::Other;
  const auto word = static_cast<std::uintptr_t>(std::strtoull(rest, nullptr, 16));
  return belongs_to_promise(word) ? ThreadWait::Future : ThreadWait::Other;
}

}  // namespace redag_rclcpp
