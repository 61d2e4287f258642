// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's id of the calling thread, without a system call. Any thread.
#pragma once

#include <cstdint>

namespace redag {

namespace detail {

// Initial exec: one load, also from a shared library. The library is loaded with the program, or its few bytes fit into
// what the C library keeps for libraries that are loaded later.
extern constinit thread_local std::uint32_t thread_id __attribute__((tls_model("initial-exec")));  // 0: not known yet
std::uint32_t learn_thread_id() noexcept;

}  // namespace detail

[[nodiscard]] inline std::uint32_t this_thread_id() noexcept {
  const std::uint32_t id = detail::thread_id;
  return id != 0 ? id : detail::learn_thread_id();
}

}  // namespace redag
