// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/thread_id.hpp"

#include <pthread.h>
#include <unistd.h>

#include "redag/base/check.hpp"

namespace redag::detail {

constinit thread_local std::uint32_t thread_id = 0;

std::uint32_t learn_thread_id() noexcept {
  // The only thread of a child process has an id of its own.
  static const int kRegistered = pthread_atfork(nullptr, nullptr, [] { thread_id = 0; });
  REDAG_CHECK(kRegistered == 0, "no memory for a handler of fork()");
  thread_id = static_cast<std::uint32_t>(gettid());
  return thread_id;
}

}  // namespace redag::detail
